"""Occupancy: a field of two classes, free and occupied, from the rays of clouds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from semgp.blocks.arrays import F64, I32, I64, Bool
from semgp.blocks.field import Field
from semgp.blocks.observations import Observations
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.free_space import FreeSpace
from semgp.maps.rays import Walk, free_samples
from semgp.prediction import OccupancyPrediction
from semgp.voxels import VoxelTable, voxel_keys

FREE, OCCUPIED = 0, 1
"""The classes of the field."""

KNOWN = 0.25
"""A point whose latent variance is above this share of the prior's is neither known to be free nor occupied.

That is about two voxels from the nearest sample. Ten SemanticKITTI scans and NYU frame 282: 98 and 99.9 % of what
an OctoMap of the same voxels knows is known, and hardly anything more than four voxels from that.
"""


class Rays(NamedTuple):
    """What a cloud tells of space: points (n, 3) with labels (n,) `FREE` or `OCCUPIED`, one a voxel.

    passed (P,): keys of voxels that were occupied and that rays have passed without an end there.
    """

    points: F64
    labels: I32
    passed: I64


class Occupancy:
    """Where something is and where nothing is.

    Parameters
    ----------
    free : FreeSpace
        The settings, with a model.
    """

    def __init__(self, free: FreeSpace) -> None:
        assert free.model is not None
        self.free, self.model = free, free.model
        self.field = Field(self.model, 2)

    def add(self, rays: Rays) -> None:
        """Add what `sample` gave."""
        confidence = np.where(rays.labels == FREE, np.float32(self.free.weight), np.float32(1))
        nothing = np.empty((len(rays.points), 0), dtype=np.float32)
        self.field.add(Observations(rays.points, rays.labels, None, nothing, confidence))

    def sample(self, cloud: LabelledCloud, origin: I64, watched: Bool) -> Rays:
        """Return the points of a cloud, as occupied, and samples along its rays, as free.

        Parameters
        ----------
        cloud : LabelledCloud
            With a pose.
        origin : (3,) array
            The voxel where the keys of the map begin.
        watched : (S,) array
            Sites; every sample in their voxels counts, and it is told which of them were passed. May be empty.

        Raises
        ------
        InputError
            A cloud without a pose, or points beyond the reach of the map.
        """
        sensor, free, resolution = cloud.origin, self.free, self.model.resolution
        if sensor is None:
            raise InputError("the cloud has no T_world_sensor, and rays begin at the sensor: give its pose.")
        sites = self.field.sites
        voxel_keys(sensor[None], resolution, origin)  # samples lie between sensor and points: both are in range
        hits, hit_keys, reach = cloud.points, voxel_keys(cloud.points, resolution, origin), np.inf
        if free.reach is not None:
            reach = free.reach
            near = ((hits - sensor) ** 2).sum(axis=1) <= reach**2
            hits, hit_keys = hits[near], hit_keys[near]
        walk = Walk(
            resolution, origin.astype(np.float64), free.rays / len(cloud), free.seed, free.margin * resolution,
            free.near * resolution, free.thin, reach,
        )  # fmt: skip
        samples, keys, passed = free_samples(sensor, cloud.points, walk, sites.voxels, watched)
        table = VoxelTable()
        at_hits = _first(table, hit_keys)
        at_samples = _first(table, keys)
        points = np.concatenate([hits[at_hits], samples[at_samples]])
        labels = np.repeat(np.array([OCCUPIED, FREE], np.int32), [len(at_hits), len(at_samples)])
        seen_through = sites.voxels.keys[np.flatnonzero(passed)]
        row = table.find(seen_through)
        return Rays(points, labels, seen_through[(row < 0) | (row >= len(at_hits))])

    def answer(self, X: F64, tolerance: float = 0.0) -> OccupancyPrediction:
        """Return what is known at points (M, 3)."""
        answers = self.field.query(X, np.empty((len(X), 0), dtype=np.float32), tolerance)
        known = answers.variance < KNOWN * self.field.prior_variance
        return OccupancyPrediction(answers.probability[:, OCCUPIED], known)

    def occupied(self, also: I64) -> Bool:
        """Return which sites (S,) rays have ended in, or whose voxels have one of these keys."""
        found = self.field.sites.mass[:, OCCUPIED] > 0
        rows = self.field.sites.voxels.find(also)
        found[rows[rows >= 0]] = True
        return np.asarray(found)

    def mostly_free(self, keys: I64) -> I64:
        """Return those of the keys of voxels whose sightings say free rather than occupied."""
        rows = self.field.sites.voxels.find(keys)
        mass = self.field.sites.mass[rows[rows >= 0]]
        return keys[rows >= 0][mass[:, FREE] > mass[:, OCCUPIED]]

    def positions(self, label: int) -> F64:
        """Return the sites (n, 3) at most of whose sightings the label, `FREE` or `OCCUPIED`, was right."""
        mass = self.field.sites.mass
        return self.field.sites.positions[mass[:, label] > mass[:, 1 - label]]


def _first(table: VoxelTable, keys: I64) -> I64:
    """Return where keys come up for the first time, and insert them."""
    newest = np.maximum.accumulate(np.concatenate([[len(table) - 1], table.insert(keys)]))
    return np.flatnonzero(np.diff(newest) > 0)
