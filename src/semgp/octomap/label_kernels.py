"""Compiled loops over the classes and colours of voxels; see `semgp.octomap.labels.VoxelLabels`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.classes import MISSING


class Chains(NamedTuple):
    """The classes of V voxels as chains of entries, with room for more of both; 0 ends a chain."""

    head: NDArray[np.int32]
    """Number of a voxel's first entry, counted from 1."""
    next: NDArray[np.int32]
    """Number of the entry that follows an entry, counted from 1."""
    label: NDArray[np.int32]
    """Class of an entry."""
    mass: NDArray[np.float32]
    """Mass of that class."""


@njit(cache=True, nogil=True)
def deposit(
    rows: NDArray[np.int64],
    labels: NDArray[np.int32],
    masses: NDArray[np.float32],
    chains: Chains,
    n: int,
) -> tuple[int, int]:
    """Add mass of a class to voxels while there is room; return how many were added, and the number of entries."""
    head, following, label, mass = chains
    for i in range(len(rows)):
        entry = head[rows[i]]
        while entry > 0 and label[entry - 1] != labels[i]:
            entry = following[entry - 1]
        if entry == 0:
            if n == len(label):
                return i, n
            following[n], label[n], mass[n] = head[rows[i]], labels[i], 0
            n += 1
            entry = n
            head[rows[i]] = n
        mass[entry - 1] += masses[i]
    return len(rows), n


@njit(cache=True, nogil=True)
def fill_mass(rows: NDArray[np.int64], chains: Chains, mass: NDArray[np.float64]) -> None:
    """Fill in the mass (M, C) of each class in voxels; rows of -1 have none."""
    for i in range(len(rows)):
        entry = chains.head[rows[i]] if rows[i] >= 0 else 0
        while entry > 0:
            mass[i, chains.label[entry - 1]] = chains.mass[entry - 1]
            entry = chains.next[entry - 1]


@njit(cache=True, nogil=True)
def fill_top(rows: NDArray[np.int64], chains: Chains, top: NDArray[np.int32]) -> None:
    """Fill in the class of most mass, the lowest one of several; `MISSING` where there is none."""
    for i in range(len(rows)):
        top[i] = MISSING
        most = np.float32(0)
        entry = chains.head[rows[i]] if rows[i] >= 0 else 0
        while entry > 0:
            label, mass = chains.label[entry - 1], chains.mass[entry - 1]
            if mass > most or (mass == most and label < top[i]):
                top[i], most = label, mass
            entry = chains.next[entry - 1]


@njit(cache=True, nogil=True)
def count_entries(rows: NDArray[np.int64], chains: Chains, count: NDArray[np.int64]) -> None:
    """Fill in the number of classes of voxels."""
    for i in range(len(rows)):
        entry = chains.head[rows[i]]
        while entry > 0:
            count[i] += 1
            entry = chains.next[entry - 1]


@njit(cache=True, nogil=True)
def list_entries(
    rows: NDArray[np.int64], chains: Chains, labels: NDArray[np.int32], masses: NDArray[np.float32]
) -> None:
    """Fill in the classes and masses of voxels, one voxel after the other."""
    n = 0
    for row in rows:
        entry = chains.head[row]
        while entry > 0:
            labels[n], masses[n] = chains.label[entry - 1], chains.mass[entry - 1]
            n += 1
            entry = chains.next[entry - 1]


@njit(cache=True, nogil=True)
def add_colours(rows: NDArray[np.int64], colours: NDArray[np.uint8], sums: NDArray[np.float32]) -> None:
    """Add red, green, blue and one point to the sums (V, 4) of voxels."""
    for i in range(len(rows)):
        for channel in range(3):
            sums[rows[i], channel] += colours[i, channel]
        sums[rows[i], 3] += 1
