"""How often scans agree about the places that they share, by the ranges that they saw them from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.reliability.votes import scan_votes, usable_scans

BINS = 24
NEAREST = 1e-3
"""Ranges below a millimetre count as one."""

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RangeAgreement:
    """How often labels that two scans gave one voxel agree.

    Parameters
    ----------
    n_classes : int
        C.
    ranges : (B,) array
        Mean range of the labels of each bin, metres, ascending; bins without labels are left out.
    pairs, agreeing : (B, B) array
        Pairs of a label from one bin and another scan's from another, and those among them that agree. All that
        one scan says of a voxel counts as one label, and so do all pairs that it is in.
    """

    n_classes: int
    ranges: F64
    pairs: F64
    agreeing: F64

    @property
    def rate(self) -> F64:
        """Share (B,) of agreeing pairs with a label from each bin; NaN for a bin without pairs."""
        pairs = self.pairs.sum(axis=1)
        unknown = np.full(len(pairs), np.nan)
        return np.asarray(np.divide(self.agreeing.sum(axis=1), pairs, out=unknown, where=pairs > 0))


def sensor_ranges(cloud: LabelledCloud) -> F64:
    """Return the distance (N,) of each point from the sensor, metres.

    Raises
    ------
    InputError
        A cloud without a pose.
    """
    if cloud.origin is None:
        raise InputError("ranges need the sensor's pose: give the cloud its T_world_sensor.")
    return np.asarray(np.linalg.norm(cloud.points - cloud.origin, axis=1))


def range_agreement(scans: Sequence[LabelledCloud], *, resolution: float = 0.2) -> RangeAgreement:
    """Count how often the labels of different scans agree in the voxels that they share, by range.

    Soft labels count as their class of most weight.

    Parameters
    ----------
    scans : sequence of LabelledCloud
        Two or more that overlap, with poses; their confidence, if any, weighs the labels.
    resolution : float, optional
        Edge of the voxels in metres: small enough to hold one class, large enough for scans to meet.

    Raises
    ------
    InputError
        Scans without a pose or with other classes, fewer than two with labels, or no voxel that two have seen.
    """
    scans = usable_scans(scans, resolution)
    ranges = [np.maximum(sensor_ranges(cloud), NEAREST) for cloud in scans]
    every = np.concatenate(ranges)
    inner_edges = np.geomspace(every.min(), every.max(), BINS + 1)[1:-1]
    bins = [np.searchsorted(inner_edges, r) for r in ranges]
    votes = scan_votes(scans, [c.hard_labels * BINS + b for c, b in zip(scans, bins)], resolution)
    label, at = np.divmod(votes.kind, BINS)
    opinion = votes.voxel * len(scans) + votes.scan
    C = len(scans[0].classes)
    # each scan of a voxel is in as many pairs as there are others, which count as one
    weight = votes.share / np.sqrt(votes.scans[votes.voxel] - 1)
    pairs = _together(weight, votes.voxel, at) - _together(weight, opinion, at)
    agreeing = _together(weight, votes.voxel * C + label, at) - _together(weight, opinion * C + label, at)
    count = np.bincount(np.concatenate(bins), minlength=BINS)
    filled = count > 0
    mean = np.bincount(np.concatenate(bins), every, BINS)[filled] / count[filled]
    pairs = np.maximum(pairs, 0)[np.ix_(filled, filled)]  # differences that should be zero may be just below
    return RangeAgreement(C, mean, pairs, np.clip(agreeing[np.ix_(filled, filled)], 0, pairs))


def _together(weight: F64, group: NDArray[np.int64], at: NDArray[np.int64]) -> F64:
    """Products of the weights of each two votes of a group, and of each with itself, summed by bins (B, B)."""
    groups, row = np.unique(group, return_inverse=True)
    A = csr_array((weight, (row, at)), shape=(len(groups), BINS))
    return np.asarray((A.T @ A).toarray())
