"""Sites made of labelled points, and what each voxel of the world holds."""

import numpy as np
from numpy.typing import NDArray

from semgp.blocks.observations import Observations
from semgp.blocks.sites import Sites
from tests.blocks.naive import Array, voxel_index

F32 = NDArray[np.float32]
Voxels = dict[tuple[int, ...], tuple[list[int], list[int]]]


def voxels(sites: Sites) -> Voxels:
    if sites.origin is None:
        return {}
    index = voxel_index(sites.voxels.keys) + sites.origin
    rows = zip(index.tolist(), sites.mass.tolist(), sites.place.tolist())
    return {tuple(v): (mass, place) for v, mass, place in rows}


def made(points: Array, weights: F32, features: F32, resolution: float, parts: int = 1) -> Sites:
    sites = Sites(weights.shape[1], features.shape[1], resolution)
    for part in np.array_split(np.arange(len(points)), parts):
        sites.add(Observations(points[part], None, weights[part], features[part]))
    return sites
