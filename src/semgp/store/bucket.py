"""Files in a bucket: S3, GCS, Azure and whatever else `obstore` speaks (extra `cloud`)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.store.files import LOCK, MOST_BYTES, Files, LocalFiles, WritersLock
from semgp.store.patience import NO_FILE, patiently, problem

if TYPE_CHECKING:
    from obstore.store import ObjectStore, RetryConfig


_AT_ONCE = 16
_ASK_ONCE: RetryConfig = {"max_retries": 0, "retry_timeout": timedelta(0)}  # `patiently` counts the tries
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

    @property
    def at_once(self) -> int:
        """How many requests to have on their way at a time."""
        return _AT_ONCE

    def read(self, name: str, most: int = MOST_BYTES) -> bytes:
        """Return what a file of so many bytes at most holds."""
        import obstore

        def get() -> bytes:
            found = obstore.get(self._bucket, name)
            if found.meta["size"] > most:
                words = f"is damaged: it has more than the {most:,} bytes that it should have."
                raise FileFormatError(f"{self.location}/{name}", words)
            return bytes(found.bytes())

        with self._reading(name):
            return patiently(get)

    def create(self, name: str, data: bytes) -> bool:
        """Create a file by a conditional put.

        Where an answer was lost on its way and the next try finds a file with these bytes, it is ours.
        """
        import obstore
        from obstore import exceptions

        tries = 0

        def put() -> None:
            nonlocal tries
            tries += 1
            obstore.put(self._bucket, name, data, mode="create")

        with self._changing("write", name):
            try:
                patiently(put)
            except exceptions.AlreadyExistsError:
                return tries > 1 and self.read(name) == data
        return True

    def names(self, folder: str) -> list[str]:
        """Return the names of the files in a folder."""
        import obstore

        with self._reading(folder):
            found = patiently(lambda: obstore.list_with_delimiter(self._bucket, folder)["objects"])
        return sorted(meta["path"].rsplit("/", 1)[1] for meta in found)

    def age(self, name: str) -> float:
        """Return the seconds since a file was created."""
        import obstore

        with self._reading(name):
            try:
                created = patiently(lambda: obstore.head(self._bucket, name))["last_modified"]
            except FileNotFoundError:
                return 0.0
        return max(0.0, (datetime.now(UTC) - created).total_seconds())

    def remove(self, name: str) -> None:
        """Remove a file where it is there."""
        import obstore

        with self._changing("remove", name), suppress(FileNotFoundError):
            patiently(lambda: obstore.delete(self._bucket, name))

    def remove_partial(self) -> int:
        """Do nothing: a put is whole or not there."""
        return 0

    def lock(self) -> WritersLock:
        """Return a lock of nothing, as other writers cannot be seen, once two could not create the same file."""
        if self.create(LOCK, b"") and self.create(LOCK, b"another's"):
            raise InputError(
                f"{self.location}: this server overwrites what it should only create (it ignores `If-None-Match: "
                "*`), so that two writers would lose each other's versions: use another one, or a newer release."
            )
        return WritersLock()

    @contextmanager
    def _reading(self, name: str) -> Iterator[None]:
        """Say of errors what could not be read."""
        from obstore import exceptions

        where = f"{self.location}/{name}"
        try:
            yield
        except (OSError, exceptions.BaseError) as error:
            words = problem(error)
            raise FileFormatError(
                where, f"{words}." if words == NO_FILE else f"cannot be read: {words}."
            ) from error

    @contextmanager
    def _changing(self, what: str, name: str) -> Iterator[None]:
        """Say of errors what could not be written or removed."""
        from obstore import exceptions

        try:
            yield
        except (OSError, exceptions.BaseError) as error:
            raise InputError(f"cannot {what} {self.location}/{name}: {problem(error)}.") from error


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
        return BucketFiles(from_url(url, retry_config=_ASK_ONCE), url.rstrip("/"))
    except (OSError, ValueError, exceptions.BaseError) as error:
        raise InputError(f"{location} cannot be opened: {problem(error)}.") from error


def as_url(location: str | Path) -> str | None:
    """Return a location as a URL, whole again where it has been a path for a while; None for a path."""
    match = _URL.fullmatch(str(location))
    if match is None:
        return None
    return f"{match[1]}://{'/' if match[1] == 'file' else ''}{match[2]}"
