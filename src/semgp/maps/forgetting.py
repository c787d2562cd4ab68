"""Forgetting: old labels count less, and places that rays pass through are given up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from semgp.blocks.accumulate import MASS_UNIT
from semgp.blocks.arrays import I64, Bool
from semgp.blocks.cells import cell_keys
from semgp.blocks.field import Field
from semgp.blocks.sites import Sites
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.settings import require_positive

FAINT = 1 / 64
"""Sites with a mass of less than this many labels count as forgotten."""


@dataclass(frozen=True)
class Forgetting:
    """How a map forgets, so that what has moved leaves no ghost.

    A cell of the map fades when a scan brings data into it, for all the time since it last did; what no scan comes
    near stays as it was. Where rays of a scan pass through an occupied voxel and none ends there, what was seen of
    it is multiplied by `passed`, and the samples on those rays say that it is free. Once they outweigh what has
    said that it is occupied, its labels fade in the same way.

    Parameters
    ----------
    half_life : float
        Time in which labels lose half their mass.
    per : "scan" or "second", optional
        The unit: updates of the map, or seconds between the clouds' stamps.
    passed : float, optional
        What a scan that sees through a site leaves of it, above 0 and at most 1.

    Raises
    ------
    InputError
        Numbers out of range, or another unit.
    """

    half_life: float
    per: str = "scan"
    passed: float = 0.5

    def __post_init__(self) -> None:
        object.__setattr__(self, "half_life", require_positive("half_life", self.half_life))
        if self.per not in ("scan", "second"):
            raise InputError(f"a half-life is counted per 'scan' or per 'second', not {self.per!r}.")
        if not 0 < self.passed <= 1:
            raise InputError(f"passed is the share that stays, above 0 and at most 1, not {self.passed}.")
        object.__setattr__(self, "passed", float(self.passed))

    def clock(self, cloud: LabelledCloud, before: float | None) -> float:
        """Return the time of a cloud, given that of the one before, or None for the first one.

        Raises
        ------
        InputError
            Seconds without a stamp, or a stamp that lies before the last one.
        """
        if self.per == "scan":
            return (before or 0.0) + 1
        if cloud.stamp is None:
            raise InputError("a half-life in seconds needs a stamp for each cloud: give one, or count scans.")
        if before is not None and cloud.stamp < before:
            raise InputError(f"the cloud of {cloud.stamp} s comes after one of {before} s: update in their order.")
        return cloud.stamp

    def fade(self, field: Field, keys: I64, now: float) -> None:
        """Fade the cells that voxels of keys (n,) lie in, before a scan at a time brings data to them."""
        sites = field.sites
        sites.clock = now
        cells = sites.cells.find(np.unique(cell_keys(keys)))
        sites.fade(cells[cells >= 0], self.half_life)
        field.touch(cells[cells >= 0].astype(np.int32))

    def give_up(self, field: Field, keys: I64) -> None:
        """Fade the sites of voxels with keys (n,), which rays have passed."""
        rows = field.sites.voxels.find(keys)
        field.touch(field.sites.fade_sites(rows[rows >= 0], self.passed))

    def to_json(self) -> dict[str, Any]:
        """Return the settings as a dictionary ready for JSON."""
        return asdict(self)

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> Forgetting:
        """Make the settings again from what `to_json` gave.

        Raises
        ------
        InputError
            Settings that are missing or unknown.
        """
        try:
            return cls(**plain)
        except TypeError as error:
            raise InputError(f"these are no settings of forgetting: {error}.") from error


def faint(sites: Sites) -> Bool:
    """Return which sites (S,) are as good as forgotten."""
    return np.asarray(sites.mass.sum(axis=1, dtype=np.int64) < FAINT * MASS_UNIT)
