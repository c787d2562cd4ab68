"""The errors that semgp raises on purpose; everything else is a bug."""

from pathlib import Path
from typing import Self


class SemgpError(Exception):
    """Base of all errors that semgp raises on purpose."""


class InputError(SemgpError, ValueError):
    """Data or settings that cannot be used; the message says what is wrong and what to do."""


class FileFormatError(InputError):
    """A file that is damaged, truncated or not of the format that it claims to be.

    Parameters
    ----------
    path : str or Path
        The file at fault.
    problem : str
        What is wrong with it, and what to do.
    """

    def __init__(self, path: str | Path, problem: str) -> None:
        super().__init__(f"{path}: {problem}")
        self.path = Path(path)
        self._parts = path, problem

    def __reduce__(self) -> tuple[type[Self], tuple[str | Path, str]]:
        """Pickle: errors come back from other processes."""
        return type(self), self._parts


class MissingExtraError(SemgpError, ImportError):
    """A feature that needs an optional dependency which is not installed.

    Parameters
    ----------
    feature : str
        What was asked for.
    extra : str
        The name of the extra that brings it.
    """

    def __init__(self, feature: str, extra: str) -> None:
        super().__init__(f"{feature} needs an optional dependency: pip install 'semgp[{extra}]'")
        self._parts = feature, extra

    def __reduce__(self) -> tuple[type[Self], tuple[str, str]]:
        """Pickle: errors come back from other processes."""
        return type(self), self._parts


class ConflictError(SemgpError):
    """Another writer was faster: what was to be written is still there, to be merged or written anew."""


class ExecutorError(SemgpError):
    """Workers that died again and again, or that cannot be reached any more; what they wrote can be used."""
