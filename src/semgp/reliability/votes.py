"""Votes: what each scan says of a voxel, one vote a scan, in the voxels that two scans or more have seen.

The labels of one scan in one voxel are no independent opinions: together they count as one, in the shares that
they have. Labels of different scans are taken as independent, given the truth. They are not quite: a network's
errors come back from scan to scan. An error that all scans make is not seen, and labels look better than they are;
the less so, the farther apart the scans were taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.voxels import VoxelTable, voxel_keys, voxel_origin


class Votes(NamedTuple):
    """The votes of V voxels: `share[i]` of the vote of scan `scan[i]` in voxel `voxel[i]` is for `kind[i]`.

    All arrays are (n,), the shares of each scan in each voxel sum to one, and no such triple occurs twice.
    `scans` (V,) is how many scans have a vote in each voxel, two at least.
    """

    voxel: NDArray[np.int64]
    scan: NDArray[np.int64]
    kind: NDArray[np.int64]
    share: NDArray[np.float64]
    scans: NDArray[np.int64]


def usable_scans(scans: Sequence[LabelledCloud], resolution: float) -> list[LabelledCloud]:
    """Return the labelled parts of the scans whose labels count for something.

    Raises
    ------
    InputError
        A resolution that is not positive, classes that differ or are one alone, or fewer than two scans with
        labels.
    """
    if not (np.isfinite(resolution) and resolution > 0):
        raise InputError(f"the resolution must be a positive number of metres, not {resolution}.")
    for cloud in scans:
        names, first = cloud.classes.names, scans[0].classes.names
        if names != first:
            raise InputError(f"the scans' classes differ: {', '.join(first)} and {', '.join(names)}.")
        if len(names) < 2:
            raise InputError(f"labels of one class, {names[0]}, cannot contradict each other: nothing to learn.")
    parts = [cloud[cloud.labelled & (label_mass(cloud) > 0)] for cloud in scans]
    parts = [part for part in parts if len(part)]
    if len(parts) < 2:
        raise InputError(f"{len(parts)} of {len(scans)} scans have labels: two must, to be compared.")
    return parts


def label_mass(cloud: LabelledCloud) -> NDArray[np.float64]:
    """Return how much each label counts (N,): its confidence, or one."""
    return np.ones(len(cloud)) if cloud.confidence is None else cloud.confidence.astype(np.float64)


def scan_votes(scans: Sequence[LabelledCloud], kinds: Sequence[NDArray[np.integer]], resolution: float) -> Votes:
    """Return the votes of `usable_scans` whose points are of these kinds, one array (N,) a scan, 0 and above.

    Raises
    ------
    InputError
        No voxel that two scans have seen, or scans a million voxels apart.
    """
    origin = voxel_origin(scans[0].points, resolution)
    table, parts = VoxelTable(), []
    n_kinds = 1 + max(int(kind.max()) for kind in kinds)
    for i, (cloud, kind) in enumerate(zip(scans, kinds, strict=True)):
        rows = table.insert(voxel_keys(cloud.points, resolution, origin))
        code, at = np.unique(rows * n_kinds + kind, return_inverse=True)
        mass = np.bincount(at, label_mass(cloud))
        voxel, said = np.divmod(code, n_kinds)
        seen, place = np.unique(voxel, return_inverse=True)
        share = mass / np.bincount(place, mass)[place]
        parts.append((voxel, np.full(len(code), i), said, share, seen))
    voxel, scan, said, share, seen = (np.concatenate(part) for part in zip(*parts))
    scans_at = np.bincount(seen, minlength=len(table))
    shared = scans_at >= 2
    if not shared.any():
        raise InputError(
            f"no voxel of {resolution:g} m has labels of two scans: take larger voxels, or scans that overlap."
        )
    keep = shared[voxel]
    renumbered = np.cumsum(shared) - 1
    return Votes(renumbered[voxel[keep]], scan[keep], said[keep], share[keep], scans_at[shared])
