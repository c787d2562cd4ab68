"""The command line: no logic, only words and pictures around the library."""

from semgp.cli.app import main

__all__ = ["main"]
