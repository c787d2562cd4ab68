"""A map in the browser: live (`LiveViewer`, extra `view`) or as one self-contained page (`page`, no extra)."""

from semgp.viewer.page import MOST_BYTES, page, write_page

__all__ = ["MOST_BYTES", "page", "write_page"]
