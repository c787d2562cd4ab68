"""Where a store keeps its files: a folder, or a bucket; files are created, never changed."""

from __future__ import annotations

import os
import secrets
import time
from pathlib import Path
from typing import Protocol

from semgp.errors import FileFormatError, InputError
from semgp.parallel import n_workers

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_PARTIAL = ".partial-"
LOCK = "writers.lock"


MOST_BYTES = 1 << 30
"""Bytes of any file of a store; a manifest of ten million tiles."""


class WritersLock:
    """A lock that writers share, which the system lets go of when a process dies.

    Parameters
    ----------
    path : Path, optional
        The locked file; left out, there is nothing to lock.

    Attributes
    ----------
    alone : bool or None
        Whether there was no other writer, and can be none until `share`; None where that cannot be known.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.alone: bool | None = None
        self._file: int | None = None
        if path is None or fcntl is None:
            return
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.alone = True
        except OSError:
            fcntl.flock(self._file, fcntl.LOCK_SH)
            self.alone = False

    def share(self) -> None:
        """Let other writers in."""
        if self._file is not None and fcntl is not None:
            fcntl.flock(self._file, fcntl.LOCK_SH)

    def release(self) -> None:
        """Count as a writer no longer."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


class Files(Protocol):
    """A flat set of named files, each of them created once, whole or not at all."""

    @property
    def location(self) -> str:
        """The folder's path or the bucket's URL, for error messages."""
        ...

    @property
    def at_once(self) -> int:
        """How many files to read or write at a time: more than there are cores where one waits for a network."""
        ...

    def read(self, name: str, most: int = MOST_BYTES) -> bytes:
        """Return what a file of so many bytes at most holds.

        Raises
        ------
        FileFormatError
            No such file, or one that is larger or cannot be read.
        """
        ...

    def create(self, name: str, data: bytes) -> bool:
        """Create a file, which then outlives a crash of the machine; False where one of that name is there."""
        ...

    def names(self, folder: str) -> list[str]:
        """Return the names of the files in a folder, sorted, without those that are not whole."""
        ...

    def age(self, name: str) -> float:
        """Return the seconds since a file was created, 0 where it is gone."""
        ...

    def remove(self, name: str) -> None:
        """Remove a file where it is there."""
        ...

    def remove_partial(self) -> int:
        """Remove what writers that died have left half written, and return how many files that was."""
        ...

    def lock(self) -> WritersLock:
        """Count as a writer, until the lock is released or the process dies."""
        ...


class LocalFiles:
    """Files in a folder.

    Parameters
    ----------
    folder : Path
        Made with the first file.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def location(self) -> str:
        """The folder's path."""
        return str(self.folder)

    @property
    def at_once(self) -> int:
        """As many as there are cores."""
        return n_workers()

    def read(self, name: str, most: int = MOST_BYTES) -> bytes:
        """Return what a file of so many bytes at most holds."""
        path = self.folder / name
        try:
            if path.exists() and not path.is_file():
                raise FileFormatError(path, "cannot be read: it is no file.")
            with path.open("rb") as file:
                data = file.read(most + 1)
        except FileNotFoundError as error:
            raise FileFormatError(path, "no such file.") from error
        except OSError as error:
            raise FileFormatError(path, f"cannot be read: {error.strerror or error}.") from error
        if len(data) > most:
            raise FileFormatError(path, f"is damaged: it has more than the {most:,} bytes that it should have.")
        return data

    def create(self, name: str, data: bytes) -> bool:
        """Create a file by linking a finished one to its name: that fails where the name is taken."""
        path = self.folder / name
        if path.exists():
            return False
        partial = path.with_name(_PARTIAL + secrets.token_hex(8))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with partial.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.link(partial, path)
        except FileExistsError:
            return False
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror or error}.") from error
        finally:
            partial.unlink(missing_ok=True)
        _sync_folder(path.parent)
        return True

    def names(self, folder: str) -> list[str]:
        """Return the names of the files in a folder."""
        try:
            return sorted(entry.name for entry in os.scandir(self.folder / folder) if entry.name[0] != ".")
        except FileNotFoundError:
            return []
        except OSError as error:
            raise FileFormatError(self.folder / folder, f"cannot be read: {error.strerror or error}.") from error

    def age(self, name: str) -> float:
        """Return the seconds since a file was created."""
        try:
            return max(0.0, time.time() - (self.folder / name).stat().st_mtime)
        except FileNotFoundError:
            return 0.0
        except OSError as error:
            raise FileFormatError(self.folder / name, f"cannot be read: {error.strerror or error}.") from error

    def remove(self, name: str) -> None:
        """Remove a file where it is there."""
        try:
            (self.folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"cannot remove {self.folder / name}: {error.strerror or error}.") from error

    def remove_partial(self) -> int:
        """Remove half-written files; only for a writer that is alone."""
        partial = [path for path in self.folder.glob(f"*/{_PARTIAL}*") if path.is_file()]
        for path in partial:
            self.remove(f"{path.parent.name}/{path.name}")
        return len(partial)

    def lock(self) -> WritersLock:
        """Take the writers' lock."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            return WritersLock(self.folder / LOCK)
        except OSError as error:
            raise InputError(f"cannot write to {self.folder}: {error.strerror or error}.") from error


def _sync_folder(folder: Path) -> None:
    """Have the names in a folder outlive a crash, where the system can."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
