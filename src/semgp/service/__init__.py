"""A map behind HTTP: `semgp serve` on one side (extra `serve`), a small client on the other (no extra)."""

from semgp.service.client import Client, UnavailableError
from semgp.service.limits import Limits

__all__ = ["Client", "Limits", "UnavailableError"]
