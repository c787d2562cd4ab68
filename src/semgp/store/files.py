"""Where a store keeps its files: a folder, or a bucket; files are created, never changed."""

from __future__ import annotations

import os
import secrets
import time
from pathlib import Path
from typing import Protocol

from semgp.errors import FileFormatError, InputError

_PARTIAL = ".partial-"
_LOCK = "writers.lock"


class Files(Protocol):
    """A flat set of named files, each of them created once, whole or not at all."""

    @property
    def location(self) -> str:
        """The folder's path or the bucket's URL, for error messages."""
        ...

    def read(self, name: str) -> bytes:
        """Return what a file holds.

        Raises
        ------
        FileFormatError
            No such file, or one that cannot be read.
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

    def start_writing(self) -> bool | None:
        """Count as a writer from now on, and tell whether there is no other one and can be none until `share`.

        None where that cannot be known.
        """
        ...

    def share(self) -> None:
        """Let other writers in."""
        ...

    def stop_writing(self) -> None:
        """Count as a writer no longer; what the system does by itself for a process that dies."""
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
        self._lock: int | None = None

    @property
    def location(self) -> str:
        """The folder's path."""
        return str(self.folder)

    def read(self, name: str) -> bytes:
        """Return what a file holds."""
        try:
            return (self.folder / name).read_bytes()
        except FileNotFoundError as error:
            raise FileFormatError(self.folder / name, "no such file.") from error
        except OSError as error:
            raise FileFormatError(self.folder / name, f"cannot be read: {error.strerror or error}.") from error

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

    def remove(self, name: str) -> None:
        """Remove a file where it is there."""
        (self.folder / name).unlink(missing_ok=True)

    def remove_partial(self) -> int:
        """Remove half-written files; only for a writer that is alone."""
        partial = [path for path in self.folder.glob(f"*/{_PARTIAL}*") if path.is_file()]
        for path in partial:
            path.unlink(missing_ok=True)
        return len(partial)

    def start_writing(self) -> bool | None:
        """Take the writers' lock for oneself, or share it."""
        try:
            import fcntl
        except ImportError:  # Windows
            return None
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(self.folder / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError as error:
            raise InputError(f"cannot write to {self.folder}: {error.strerror or error}.") from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            fcntl.flock(self._lock, fcntl.LOCK_SH)
            return False
        return True

    def share(self) -> None:
        """Share the writers' lock."""
        if self._lock is not None:
            import fcntl

            fcntl.flock(self._lock, fcntl.LOCK_SH)

    def stop_writing(self) -> None:
        """Let go of the writers' lock."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def _sync_folder(folder: Path) -> None:
    """Have the names in a folder outlive a crash, where the system can."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
