"""Files in a bucket: S3, GCS, Azure and whatever else `obstore` speaks (extra `cloud`)."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.store.files import MOST_BYTES, Files, LocalFiles, WritersLock

if TYPE_CHECKING:
    from obstore.store import ObjectStore


_URL = re.compile(r"([a-z][a-z0-9+]+):/{1,3}(.+)", re.DOTALL)


class BucketFiles:
    """Files in an object store.

    Writers cannot see each other there: `clean` is for a time when nobody writes.

    Parameters
    ----------
    bucket : obstore.store.ObjectStore
        With its prefix, if it has one.
    location : str
        Its URL, for error messages.
    """

    def __init__(self, bucket: ObjectStore, location: str) -> None:
        self._bucket = bucket
        self._location = location

    @property
    def location(self) -> str:
        """The bucket's URL."""
        return self._location

    def read(self, name: str, most: int = MOST_BYTES) -> bytes:
        """Return what a file of so many bytes at most holds."""
        import obstore
        from obstore import exceptions

        try:
            found = obstore.get(self._bucket, name)
            if found.meta["size"] > most:
                problem = f"is damaged: it has more than the {most:,} bytes that it should have."
                raise FileFormatError(f"{self.location}/{name}", problem)
            return bytes(found.bytes())
        except FileNotFoundError as error:
            raise FileFormatError(f"{self.location}/{name}", "no such file.") from error
        except (OSError, exceptions.BaseError) as error:
            raise FileFormatError(f"{self.location}/{name}", f"cannot be read: {_short(error)}.") from error

    def create(self, name: str, data: bytes) -> bool:
        """Create a file by a conditional put."""
        import obstore
        from obstore import exceptions

        try:
            obstore.put(self._bucket, name, data, mode="create")
        except exceptions.AlreadyExistsError:
            return False
        except (OSError, exceptions.BaseError) as error:
            raise InputError(f"cannot write {self.location}/{name}: {_short(error)}.") from error
        return True

    def names(self, folder: str) -> list[str]:
        """Return the names of the files in a folder."""
        import obstore
        from obstore import exceptions

        try:
            found = [meta["path"] for batch in obstore.list(self._bucket, folder) for meta in batch]
        except (OSError, exceptions.BaseError) as error:
            raise FileFormatError(f"{self.location}/{folder}", f"cannot be read: {_short(error)}.") from error
        return sorted(path.rsplit("/", 1)[1] for path in found)

    def age(self, name: str) -> float:
        """Return the seconds since a file was created."""
        import obstore
        from obstore import exceptions

        try:
            created = obstore.head(self._bucket, name)["last_modified"]
        except FileNotFoundError:
            return 0.0
        except (OSError, exceptions.BaseError) as error:
            raise FileFormatError(f"{self.location}/{name}", f"cannot be read: {_short(error)}.") from error
        return max(0.0, (datetime.now(UTC) - created).total_seconds())

    def remove(self, name: str) -> None:
        """Remove a file where it is there."""
        import obstore
        from obstore import exceptions

        try:
            obstore.delete(self._bucket, name)
        except FileNotFoundError:
            return
        except (OSError, exceptions.BaseError) as error:
            raise InputError(f"cannot remove {self.location}/{name}: {_short(error)}.") from error

    def remove_partial(self) -> int:
        """Do nothing: a put is whole or not there."""
        return 0

    def lock(self) -> WritersLock:
        """Return a lock of nothing: other writers cannot be seen."""
        return WritersLock()


def open_files(location: str | Path) -> Files:
    """Return the files at a path, or at a URL such as s3://bucket/drive, gs://..., az://...

    Raises
    ------
    InputError
        A URL that names no bucket, or settings that are missing; MissingExtraError without `obstore`.
    """
    url = as_url(location)
    if url is None or url.startswith("file:"):
        return LocalFiles(Path(location if url is None else url.removeprefix("file://")))
    try:
        from obstore import exceptions
        from obstore.store import from_url
    except ImportError as error:
        raise MissingExtraError(f"a map at {location}", "cloud") from error
    try:
        return BucketFiles(from_url(url), url.rstrip("/"))
    except (OSError, ValueError, exceptions.BaseError) as error:
        raise InputError(f"{location} cannot be opened: {_short(error)}.") from error


def _short(error: Exception) -> str:
    """The first line of an error, without its stop: the others are for those who debug."""
    return str(error).split("\n", 1)[0].rstrip(".")


def as_url(location: str | Path) -> str | None:
    """Return a location as a URL, whole again where it has been a path for a while; None for a path."""
    match = _URL.fullmatch(str(location))
    if match is None:
        return None
    return f"{match[1]}://{'/' if match[1] == 'file' else ''}{match[2]}"
