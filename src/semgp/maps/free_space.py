"""Free space: what a map assumes of it, and how it is sampled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from semgp.blocks.model import BlockModel
from semgp.errors import InputError
from semgp.gp.stationary import Matern52
from semgp.maps.settings import require_positive

_MOST = 1 << 31  # rays, and voxels of which one counts


def occupancy_model(resolution: float, vertical: int | None = None) -> BlockModel:
    """Return a model of free and occupied, learned from ten SemanticKITTI scans, for voxels of another size.

    Lengths are in proportion to the voxels. Blocks are smaller than those of labels, because free space is dense.

    Parameters
    ----------
    resolution : float
        Edge of a voxel in metres.
    vertical : int, optional
        Axis of gravity, for a spinning lidar, whose rays graze the ground: along it lengths are shorter. None for
        the same lengths along all axes.
    """
    near, far = [1.6 * resolution] * 3, [12.0 * resolution] * 3
    if vertical is not None:
        near[vertical], far[vertical] = 0.9 * resolution, 2.5 * resolution
    kernel = Matern52(ell=tuple(near), sf=0.85) + Matern52(ell=tuple(far), sf=1.8)
    return BlockModel(
        kernel=kernel, resolution=resolution, s_n=0.13, nugget=0.06, a=0.22, delta=0.006, v_0=0.05,
        weights=(0.58, 0.64, 0.11), leaf=48, near=4, far=12,
    )  # fmt: skip


@dataclass(frozen=True)
class FreeSpace:
    """Samples along the rays between sensor and points: what a map needs to tell free from occupied.

    A share of the rays, drawn with the seed, is sampled once a voxel on the way from `margin` voxels before the
    point to the sensor. Of the samples more than `near` voxels before the point only those in one voxel in `thin`
    count: free space is wide and dull. A voxel counts once a scan, and not at all where a ray of the scan ends.

    Parameters
    ----------
    model : BlockModel, optional
        Kernel, noise and link of the occupancy; its resolution must be the map's. Left out, `occupancy_model`.
    rays : int, optional
        About so many rays a scan, which bounds its cost.
    weight : float, optional
        What one sample counts against one end of a ray; OctoMap's defaults are in the proportion 0.48.
    margin, near : float, optional
        Voxels, see above.
    thin : int, optional
        See above; 1 keeps all.
    reach : float, optional
        Rays are cut at this length, metres; what lies beyond is neither free nor occupied. None for no limit. A
        point beyond it, without a label, tells of a direction in which the sensor saw nothing.
    seed : int, optional
        Seed of the draw of rays.

    Raises
    ------
    InputError
        Numbers out of range.
    """

    model: BlockModel | None = None
    rays: int = 24_576
    weight: float = 0.7
    margin: float = 1.0
    near: float = 1.5
    thin: int = 6
    reach: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("weight", "margin", "near", "reach"):
            if name != "reach" or self.reach is not None:
                object.__setattr__(self, name, require_positive(name, getattr(self, name)))
        if not 1e-3 <= self.weight <= 64:
            raise InputError(f"the weight of a sample is that of 0.001 to 64 ends of rays, not {self.weight}.")
        for name in ("rays", "thin", "seed"):
            value = getattr(self, name)
            if isinstance(value, np.integer):
                object.__setattr__(self, name, int(value))
        if not all(isinstance(v, int) and 1 <= v <= _MOST for v in (self.rays, self.thin)):
            raise InputError(f"rays and thin are whole numbers, 1 to {_MOST:,}.")
        if not isinstance(self.seed, int) or not 0 <= self.seed < 1 << 63:
            raise InputError(f"the seed is a whole number of 63 bits, 0 or above, not {self.seed!r}.")

    def of_resolution(self, resolution: float) -> FreeSpace:
        """Return the same with its model for a map of this resolution filled in.

        Raises
        ------
        InputError
            A model of another resolution, or for other inputs than position.
        """
        model = occupancy_model(resolution) if self.model is None else self.model
        if model.resolution != resolution or model.features or model.other:
            raise InputError(
                f"a model of free space has the resolution of its map, {resolution} m, and no features: "
                "make it with occupancy_model(resolution)."
            )
        return replace(self, model=model)

    def to_json(self) -> dict[str, Any]:
        """Return the settings as a dictionary ready for JSON."""
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return plain | {"model": None if self.model is None else self.model.to_json()}

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> FreeSpace:
        """Make the settings again from what `to_json` gave.

        Raises
        ------
        InputError
            Settings that are missing or unknown.
        """
        try:
            model = plain["model"]
            return cls(**{**plain, "model": None if model is None else BlockModel.from_json(model)})
        except (KeyError, TypeError) as error:
            raise InputError(f"these are no settings of free space: {error}.") from error
