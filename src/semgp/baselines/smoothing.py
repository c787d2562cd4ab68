"""The inner loop of Bayesian kernel inference: labels spread over the voxels within reach."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from semgp.voxels import STEP, hash_slots, slot_of


def sparse_kernel(r: ArrayLike) -> NDArray[np.float64]:
    """Return the sparse kernel at distances `r`, in units of its radius: 1 at 0, and 0 from 1 on.

    Source: Melkumyan and Ramos (2009), "A Sparse Covariance Function for Exact Gaussian Process Inference in
    Large Datasets".
    """
    r = np.minimum(r, 1.0)
    turn = 2 * np.pi * r
    return np.asarray(np.maximum((2 + np.cos(turn)) / 3 * (1 - r) + np.sin(turn) / (2 * np.pi), 0))


# Sine and cosine would be most of the work. In r^2 the kernel is so smooth that a table, interpolated
# linearly, is exact to 4e-7; the last entry is a spare for r = 1.
_STEPS = 4096
_KERNEL = sparse_kernel(np.sqrt(np.arange(_STEPS + 2) / _STEPS))


def spread(
    keys: NDArray[np.int64],
    fraction: NDArray[np.float64],
    mass: NDArray[np.float32],
    reach: float,
    scale: float,
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Add the class mass of points, weighted by the kernel, to all voxels whose centres are within reach.

    Parameters
    ----------
    keys : (N,) array
        Key of the voxel that each point lies in; sorted keys go fastest.
    fraction : (N, 3) array
        Position of each point in its voxel, 0 to 1 along each axis.
    mass : (N, C) array
        Class mass of each point.
    reach : float
        Radius of the kernel, in voxels.
    scale : float
        Kernel at distance zero.

    Returns
    -------
    voxels : (V,) array
        Keys of the voxels reached.
    total : (V, C) array
        Weighted class mass of each.
    """
    voxels, total = _spread(keys, fraction, mass, reach, scale * _KERNEL)
    return voxels, total


@njit(cache=True, nogil=True)
def _interpolated(rr: float, kernel: NDArray[np.float64]) -> np.float32:
    step = int(rr * _STEPS)
    part = rr * _STEPS - step
    return np.float32((1 - part) * kernel[step] + part * kernel[step + 1])


@njit(cache=True, nogil=True)
def _spread(
    keys: NDArray[np.int64],
    fraction: NDArray[np.float64],
    mass: NDArray[np.float32],
    reach: float,
    kernel: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    n_classes = mass.shape[1]
    half = math.floor(reach + 0.5)  # no farther voxel has its centre within reach of a point in this one
    side = 2 * half + 1
    capacity = 2 * side**3 + 1024
    voxels = np.empty(capacity, dtype=np.int64)
    total = np.zeros((capacity, n_classes), dtype=np.float32)
    slots = hash_slots(voxels, 0, capacity)
    n = 0
    row_of = np.empty((side, side, side), dtype=np.int64)  # rows of the voxels around the point's, once known
    classes = np.empty(n_classes, dtype=np.int64)
    for i in range(len(keys)):
        if n + side**3 > capacity:
            voxels = np.concatenate((voxels, np.empty_like(voxels)))
            total = np.concatenate((total, np.zeros_like(total)))
            capacity *= 2
            slots = hash_slots(voxels, n, capacity)
        if i == 0 or keys[i] != keys[i - 1]:
            row_of[:] = -1
        n_labels = 0
        for c in range(n_classes):
            if mass[i, c] > 0:
                classes[n_labels] = c
                n_labels += 1
        x, y, z = fraction[i, 0] - 0.5, fraction[i, 1] - 0.5, fraction[i, 2] - 0.5
        for dx in range(math.ceil(x - reach), math.floor(x + reach) + 1):
            for dy in range(math.ceil(y - reach), math.floor(y + reach) + 1):
                for dz in range(math.ceil(z - reach), math.floor(z + reach) + 1):
                    rr = ((dx - x) ** 2 + (dy - y) ** 2 + (dz - z) ** 2) / reach**2
                    if rr >= 1:
                        continue
                    row = row_of[dx + half, dy + half, dz + half]
                    if row < 0:
                        key = keys[i] + dx * STEP[0] + dy * STEP[1] + dz * STEP[2]
                        slot = slot_of(key, slots, voxels)
                        if slots[slot] < 0:
                            slots[slot], voxels[n] = n, key
                            n += 1
                        row = slots[slot]
                        row_of[dx + half, dy + half, dz + half] = row
                    k = _interpolated(rr, kernel)
                    for j in range(n_labels):
                        total[row, classes[j]] += k * mass[i, classes[j]]
    return voxels[:n], total[:n]
