"""What a reader is, and the lazy sequence of scans that it gives."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, overload

from semgp.cloud import LabelledCloud


class Reader(Protocol):
    """One format: how to tell it, and how to read it."""

    @property
    def name(self) -> str:
        """Short name of the format."""
        ...

    @property
    def layout(self) -> str:
        """What a file or folder of the format looks like, for error messages."""
        ...

    def matches(self, path: Path) -> bool:
        """Tell from a path that exists, by its name or its folder's contents, whether it is of this format."""
        ...

    def scans(self, path: Path, *_: Any, **options: Any) -> Sequence[LabelledCloud]:
        """Return the scans at a path, each read when it is asked for.

        Raises
        ------
        FileFormatError
            Files that are missing, damaged or not of the format.
        """
        ...


@dataclass(frozen=True)
class Scans(Sequence[LabelledCloud]):
    """A sequence of clouds that are read when asked for, and not kept.

    Parameters
    ----------
    indices : sequence of int
        What to hand to `scan` for each cloud.
    scan : callable
        Reads one cloud.
    """

    indices: Sequence[int]
    scan: Callable[[int], LabelledCloud]

    def __len__(self) -> int:
        return len(self.indices)

    @overload
    def __getitem__(self, i: int) -> LabelledCloud: ...
    @overload
    def __getitem__(self, i: slice) -> Scans: ...
    def __getitem__(self, i: int | slice) -> LabelledCloud | Scans:
        """Read one cloud, or return the sequence of some."""
        if isinstance(i, slice):
            return Scans(self.indices[i], self.scan)
        return self.scan(self.indices[i])


@dataclass(frozen=True)
class FileReader:
    """The reader of a format that has one scan a file, told by the file's extension.

    Parameters
    ----------
    name, layout : str
        As in `Reader`.
    extension : str
        Lower case, with its dot.
    read : callable
        Takes a path and the format's options, and returns the cloud.
    """

    name: str
    layout: str
    extension: str
    read: Callable[..., LabelledCloud]

    def matches(self, path: Path) -> bool:
        """Tell whether the path is a file with the extension."""
        return path.is_file() and path.suffix.lower() == self.extension

    def scans(self, path: Path, **options: Any) -> Sequence[LabelledCloud]:
        """Return the file's one scan."""
        return Scans(range(1), lambda _: self.read(path, **options))


def options_of(reader: Reader) -> tuple[str, ...]:
    """Return the names of the options that a reader takes: what its function takes by keyword only."""
    function = reader.read if isinstance(reader, FileReader) else reader.scans
    parameters = inspect.signature(function).parameters.values()
    return tuple(p.name for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY)
