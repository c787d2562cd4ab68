"""Settings: what never changes in a stored map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from semgp.blocks.model import BlockModel
from semgp.classes import Classes
from semgp.maps.blocks import ManyBlocks
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.tiles import Tiling
from semgp.upward import Up, vertical


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
    up : str, optional
        The axis of the world that points upwards, see `semgp.upward`.

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
    up: Up = "z"

    def __post_init__(self) -> None:
        self.new_state()
        vertical(self.up)

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
            "up": self.up,
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
            plain.get("up", "z"),
        )
