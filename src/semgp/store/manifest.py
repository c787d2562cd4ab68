"""Manifests: what a version of a stored map is made of.

A manifest is a text file of two lines: the SHA-256 of the second line in hexadecimal digits, and JSON. It names no
files: a tile's follows from its key and its checksum.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from semgp.blocks.arrays import I64
from semgp.blocks.cells import CELL
from semgp.errors import InputError
from semgp.maps.tiles import Tiling
from semgp.store.settings import Settings
from semgp.voxels import EXACT

FORMAT = "semgp-store"
VERSION = 1

_FARTHEST = int(EXACT)
_DIGEST = re.compile(r"[0-9a-f]{64}")
_DAMAGE = (
    *(InputError, ValueError, KeyError, TypeError, IndexError),
    *(AttributeError, ArithmeticError, RecursionError),
)


class Tile(NamedTuple):
    """A tile's file: its SHA-256, bytes, and sites of labels and of free space."""

    digest: str
    n_bytes: int
    sites: int
    free_sites: int

    @property
    def all_sites(self) -> int:
        """Sites of labels and of free space: what the tile takes in memory."""
        return self.sites + self.free_sites

    def name(self, key: int) -> str:
        """Return the name of the file of the tile with a key."""
        return f"{key:016x}-{self.digest[:32]}.npz"


@dataclass(frozen=True)
class Manifest:
    """A version of a stored map.

    Parameters
    ----------
    number : int
        Versions count from 1.
    settings : Settings
        The same in all versions.
    time : str
        When it was written, ISO 8601, UTC.
    note : str
        What its writer says of it.
    clouds : int
        How many clouds the map has taken in.
    origin : tuple of int or None
        Voxel where the keys begin, None as long as the map is empty.
    clock : float or None
        The map's time, for maps that forget.
    tiles : mapping of int to Tile
        By their keys.
    """

    number: int
    settings: Settings
    time: str
    note: str = ""
    clouds: int = 0
    origin: tuple[int, int, int] | None = None
    clock: float | None = None
    tiles: Mapping[int, Tile] = field(default_factory=dict)

    @property
    def sites(self) -> int:
        """Number of sites of labels."""
        return sum(tile.sites for tile in self.tiles.values())

    @property
    def free_sites(self) -> int:
        """Number of sites of free space."""
        return sum(tile.free_sites for tile in self.tiles.values())

    @property
    def n_bytes(self) -> int:
        """Bytes of all tiles' files."""
        return sum(tile.n_bytes for tile in self.tiles.values())

    def to_bytes(self) -> bytes:
        """Return the manifest's file."""
        plain = {
            "format": FORMAT,
            "version": VERSION,
            "number": self.number,
            "time": self.time,
            "note": self.note,
            "clouds": self.clouds,
            "origin": self.origin,
            "clock": self.clock,
            **self.settings.to_json(),
            "tiles": [[key, *tile] for key, tile in sorted(self.tiles.items())],
        }
        line = json.dumps(plain, allow_nan=False, separators=(",", ":")).encode()
        return hashlib.sha256(line).hexdigest().encode() + b"\n" + line + b"\n"

    @classmethod
    def from_bytes(cls, data: bytes) -> Manifest:
        """Make the manifest again from its file.

        Raises
        ------
        InputError
            A file that is damaged, no manifest, or written by a newer version.
        """
        digest, _, line = data.rstrip(b"\n").partition(b"\n")
        if hashlib.sha256(line).hexdigest().encode() != digest:
            raise InputError("is damaged: its checksum does not fit.")
        try:
            plain = json.loads(line, parse_constant=_refuse)
            if plain["format"] != FORMAT:
                raise InputError(f"is no manifest of a stored map: its format is {plain['format']!r}.")
            if _whole(plain["version"], 1) > VERSION:
                raise InputError(f"was written by a newer semgp (format {plain['version']}): upgrade semgp.")
            origin, clock = plain["origin"], plain["clock"]
            if origin is None and plain["tiles"]:
                raise InputError("is damaged: it has tiles, but no origin.")
            return cls(
                number=_whole(plain["number"], 1),
                settings=Settings.from_json(plain),
                time=str(plain["time"]),
                note=str(plain["note"]),
                clouds=_whole(plain["clouds"], 0),
                origin=None if origin is None else _origin(origin),
                clock=None if clock is None else _finite(clock),
                tiles=_tiles(plain["tiles"], Tiling(plain["tile_cells"])),
            )
        except _DAMAGE as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"is damaged: {type(error).__name__}: {error}") from error


def voxel(origin: I64 | None) -> tuple[int, int, int] | None:
    """Return a voxel (3,) as whole numbers for a manifest."""
    return None if origin is None else (int(origin[0]), int(origin[1]), int(origin[2]))


def _whole(value: Any, least: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise InputError(f"is damaged: {value!r} where a whole number belongs.")
    return value


def _origin(plain: Any) -> tuple[int, int, int]:
    x, y, z = (_whole(v, -_FARTHEST) for v in plain)
    if any(v % CELL or v > _FARTHEST for v in (x, y, z)):
        raise InputError("is damaged: its origin is no corner of a cell.")
    return x, y, z


def _finite(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"is damaged: {value!r} where a number belongs.")
    return float(value)


def _refuse(constant: str) -> float:
    raise InputError(f"is damaged: {constant} is no number.")


def _tiles(rows: Any, tiling: Tiling) -> dict[int, Tile]:
    keys = np.array([_whole(key, 0) for key, *_ in rows], dtype=np.int64)
    if (tiling.keys(keys) != keys).any() or len(np.unique(keys)) < len(keys):
        raise InputError("is damaged: a key that is no tile's, or occurs twice.")
    tiles: dict[int, Tile] = {}
    most = 1 << 3 * tiling.bits
    for key, digest, *counts in rows:
        if not isinstance(digest, str) or not _DIGEST.fullmatch(digest):
            raise InputError(f"is damaged: {digest!r} is no checksum.")
        n_bytes, sites, free_sites = (_whole(count, 0) for count in counts)
        if max(sites, free_sites) > most:
            raise InputError(f"is damaged: a tile cannot have {max(sites, free_sites)} sites.")
        tiles[key] = Tile(digest, n_bytes, sites, free_sites)
    return tiles
