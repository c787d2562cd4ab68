"""Walks along rays in plain Python, and what is sampled along them."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.maps.rays import Walk, free_samples
from semgp.voxels import VoxelTable, voxel_indices

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]

EDGE = 0.1
NONE = 2**30
"""So thin that no sample counts for its voxel alone."""


def walk(**changed: Any) -> Walk:
    plain: dict[str, Any] = {
        "resolution": EDGE, "origin": np.zeros(3), "share": 1.0, "seed": 0, "margin": EDGE, "near": 3 * EDGE,
        "thin": 1, "reach": np.inf,
    }  # fmt: skip
    return Walk(**(plain | changed))


def sampled(sensor: F64, points: F64, settings: Walk) -> tuple[F64, I64]:
    samples, keys, passed = free_samples(sensor, points, settings, VoxelTable(), np.empty(0, dtype=bool))
    assert len(passed) == 0
    return samples, keys


def world(keys: I64, settings: Walk) -> I64:
    """Voxels (n, 3) counted from the origin of the world."""
    return voxel_indices(keys, settings.origin.astype(np.int64))


def around(sensor: F64, n: int, seed: int, shortest: float = 0.05, longest: float = 6.0) -> F64:
    rng = np.random.default_rng(seed)
    d = rng.normal(size=(n, 3))
    return np.asarray(
        sensor + d / np.linalg.norm(d, axis=1, keepdims=True) * rng.uniform(shortest, longest, (n, 1))
    )


def phases(sensor: F64, points: F64, seed: int) -> F64:
    """By which share of a voxel the first sample of each ray lies nearer to the sensor than it could."""
    step = 0.02
    reach = step * (2 - 1e-6)  # exactly one sample a ray fits in
    samples, _ = sampled(sensor, points, walk(resolution=step, margin=0.0, reach=reach, seed=seed))
    assert len(samples) == len(points)
    return np.asarray((reach - np.linalg.norm(samples - sensor, axis=1)) / step)


def naive_walk(sensor: F64, points: F64, settings: Walk) -> tuple[F64, Bool]:
    """All samples (n, 3) along rays, whatever their voxel, and which lie near the ends of theirs."""
    samples, near = [], []
    for point, phase in zip(points, phases(sensor, points, settings.seed)):
        length = math.dist(sensor, point)
        t = min(length - settings.margin, settings.reach) - phase * settings.resolution
        while t >= settings.resolution and length >= settings.resolution:
            samples.append(sensor + t / length * (point - sensor))
            near.append(t > length - settings.near)
            t -= settings.resolution
    return np.array(samples).reshape(-1, 3), np.array(near, dtype=bool)


def off_faces(samples: F64, resolution: float) -> Bool:
    """Samples that lie so deep in their voxels that rounding does not matter."""
    inside = samples / resolution - np.floor(samples / resolution)
    return np.asarray((np.abs(inside - 0.5) < 0.5 - 1e-5).all(axis=1))
