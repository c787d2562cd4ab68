"""Manifests: what a version of a stored map is made of.

A manifest is a text file of two lines: the SHA-256 of the second line in hexadecimal digits, and JSON. It names no
files: a tile's follows from its key and its checksum.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from semgp.blocks.cells import CELL
from semgp.blocks.model import BlockModel
from semgp.classes import Classes
from semgp.errors import InputError
from semgp.maps.blocks import ManyBlocks
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.tiles import Tiling

FORMAT = "semgp-store"
VERSION = 1

_DIGEST = re.compile(r"[0-9a-f]{64}")
_DAMAGE = (InputError, ValueError, KeyError, TypeError, IndexError, AttributeError, OverflowError, RecursionError)


class Tile(NamedTuple):
    """A tile's file: its SHA-256, bytes, and sites of labels and of free space."""

    digest: str
    n_bytes: int
    sites: int
    free_sites: int

    def name(self, key: int) -> str:
        """Return the name of the file of the tile with a key."""
        return f"{key:016x}-{self.digest[:32]}.npz"


@dataclass(frozen=True)
class Settings:
    """What never changes in a stored map.

    Parameters
    ----------
    classes : Classes
        The map's classes.
    model : BlockModel
        The map's model.
    free : FreeSpace, optional
        Where the map keeps free space.
    forgetting : Forgetting, optional
        Where the map forgets.
    tiling : Tiling, optional
        How cells make tiles.

    Raises
    ------
    InputError
        Settings that do not go together, see `GPSemanticMap`.
    """

    classes: Classes
    model: BlockModel
    free: FreeSpace | None = None
    forgetting: Forgetting | None = None
    tiling: Tiling = field(default_factory=Tiling)

    def __post_init__(self) -> None:
        self.new_state()

    @property
    def resolution(self) -> float:
        """Edge of a voxel in metres."""
        return self.model.resolution

    @property
    def half_blend(self) -> float:
        """Voxels from a point to the farthest block that has a say in its answer, of labels or of free space."""
        model = None if self.free is None else self.free.of_resolution(self.resolution).model
        return max(m.blend for m in (self.model, model) if m is not None) / 2

    def new_state(self) -> ManyBlocks:
        """Return an empty map with these settings."""
        return ManyBlocks(self.classes, self.model, self.free, self.forgetting)

    def to_json(self) -> dict[str, Any]:
        """Return the settings as a dictionary ready for JSON."""
        return {
            "classes": {"names": self.classes.names, "colours": self.classes.colours},
            "model": self.model.to_json(),
            "free": None if self.free is None else self.free.to_json(),
            "forgetting": None if self.forgetting is None else self.forgetting.to_json(),
            "tile_cells": self.tiling.cells,
        }

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> Settings:
        """Make the settings again from what `to_json` gave; errors as in `Manifest.from_bytes`."""
        free, forgetting, classes = plain["free"], plain["forgetting"], plain["classes"]
        return cls(
            Classes(tuple(classes["names"]), tuple(tuple(colour) for colour in classes["colours"])),
            BlockModel.from_json(plain["model"]),
            None if free is None else FreeSpace.from_json(free),
            None if forgetting is None else Forgetting.from_json(forgetting),
            Tiling(plain["tile_cells"]),
        )


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
            plain = json.loads(line)
            if plain["format"] != FORMAT:
                raise InputError(f"is no manifest of a stored map: its format is {plain['format']!r}.")
            if plain["version"] > VERSION:
                raise InputError(f"was written by a newer semgp (format {plain['version']}): upgrade semgp.")
            origin, clock = plain["origin"], plain["clock"]
            return cls(
                number=_whole(plain["number"], 1),
                settings=Settings.from_json(plain),
                time=str(plain["time"]),
                note=str(plain["note"]),
                clouds=_whole(plain["clouds"], 0),
                origin=None if origin is None else _origin(origin),
                clock=None if clock is None else float(clock),
                tiles=_tiles(plain["tiles"], Tiling(plain["tile_cells"])),
            )
        except _DAMAGE as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"is damaged: {type(error).__name__}: {error}") from error


def _whole(value: Any, least: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise InputError(f"is damaged: {value!r} where a whole number belongs.")
    return value


def _origin(plain: Any) -> tuple[int, int, int]:
    x, y, z = (int(np.int64(v)) for v in plain)
    if any(v % CELL for v in (x, y, z)):
        raise InputError("is damaged: its origin is no corner of a cell.")
    return x, y, z


def _tiles(rows: Any, tiling: Tiling) -> dict[int, Tile]:
    tiles: dict[int, Tile] = {}
    for key, digest, *counts in rows:
        if (
            not 0 <= _whole(key, 0) < 1 << 63
            or int(tiling.keys(np.array([key], dtype=np.int64))[0]) != key
            or key in tiles
        ):
            raise InputError(f"is damaged: {key} is no key of a tile, or occurs twice.")
        if not isinstance(digest, str) or not _DIGEST.fullmatch(digest):
            raise InputError(f"is damaged: {digest!r} is no checksum.")
        n_bytes, sites, free_sites = (_whole(count, 0) for count in counts)
        tiles[key] = Tile(digest, n_bytes, sites, free_sites)
    return tiles
