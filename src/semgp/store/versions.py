"""The versions of a stored map: manifests, each created once, that are listed, read and published."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime

from semgp.errors import ConflictError, FileFormatError, InputError
from semgp.store.files import Files
from semgp.store.manifest import Manifest

_NAME = re.compile(r"([0-9]{8,18})\.json")


class Versions:
    """The manifests of one map.

    Each is a file named by its number, created whole or not at all and never overwritten; a version is there when
    its manifest is. Whoever creates the next number first has won.

    Parameters
    ----------
    files : Files
        Where they are.
    """

    def __init__(self, files: Files) -> None:
        self.files = files

    @property
    def location(self) -> str:
        """The folder's path or the bucket's URL."""
        return self.files.location

    def numbers(self) -> list[int]:
        """Return the numbers of the versions, ascending."""
        found = (_NAME.fullmatch(name) for name in self.files.names("manifests"))
        return sorted(int(match[1]) for match in found if match)

    def manifest(self, number: int | None = None) -> Manifest:
        """Return a version's manifest, the newest by default.

        Raises
        ------
        InputError
            No map at the location, or no such version; FileFormatError for a damaged manifest.
        """
        numbers = self.numbers()
        if not numbers:
            raise InputError(f"{self.location} holds no map: `semgp build` makes one.")
        wanted = numbers[-1] if number is None else number
        if wanted not in numbers:
            raise InputError(f"{self.location} has no version {wanted}, but {_listed(numbers)}.")
        name = manifest_name(wanted)
        try:
            manifest = Manifest.from_bytes(self.files.read(name))
            if manifest.number != wanted:
                raise InputError(f"is damaged: it says that it is version {manifest.number}.")
        except FileFormatError:
            if number is None and wanted not in self.numbers():  # others have gone on, and removed it
                return self.manifest()
            raise
        except InputError as error:
            hint = "" if len(numbers) < 2 else " Other versions may be whole: `semgp store versions`."
            raise FileFormatError(f"{self.location}/{name}", f"{error}{hint}") from error
        return manifest

    def require_still(self, number: int) -> None:
        """Raise ConflictError where a version that was there has been removed."""
        if number not in self.numbers():
            raise ConflictError(
                f"{self.location}: version {number} has been removed since this map was opened at it: refresh the "
                "map, or open it anew."
            )

    def publish(self, manifest: Manifest, note: str = "") -> Manifest:
        """Create the version that follows a manifest's number, of its tiles, and return its manifest.

        Raises
        ------
        ConflictError
            The newest version is another one: another writer was faster.
        """
        following = following_of(manifest, note)
        self.add(following)
        return following

    def add(self, manifest: Manifest) -> None:
        """Create a version, the next one.

        Raises
        ------
        ConflictError
            The newest version is not the one before: another writer was faster.
        """
        name, before = manifest_name(manifest.number), manifest.number - 1
        newest = max(self.numbers(), default=0)  # the next number may be free again: old versions are removed
        if newest != before or not self.files.create(name, manifest.to_bytes()):
            raise ConflictError(
                f"{self.location}: another writer has made version {max(newest, manifest.number)} since version "
                f"{before} was read. Merge with it, or open the map anew and try again."
            )

    def has(self, manifest: Manifest) -> bool:
        """Tell whether a version is there, and is this one to the last byte."""
        name = manifest_name(manifest.number)
        return manifest.number in self.numbers() and self.files.read(name) == manifest.to_bytes()


def following_of(manifest: Manifest, note: str = "") -> Manifest:
    """Return the version that is to follow a manifest's number, of its tiles, as of now."""
    time = datetime.now(UTC).isoformat(timespec="milliseconds")
    return replace(manifest, number=manifest.number + 1, time=time, note=note)


def manifest_name(number: int) -> str:
    """Return the name of the file of a version's manifest."""
    return f"manifests/{number:08d}.json"


def _listed(numbers: list[int]) -> str:
    """Numbers as words, such as 3, or 1 to 4, 7 to 9."""
    runs = [[numbers[0], numbers[0]]]
    for number in numbers[1:]:
        if number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ", ".join(f"{first}" if first == last else f"{first} to {last}" for first, last in runs)
