"""Classes and colour of the voxels that rays ended in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.settings import stored_array
from semgp.octomap import label_kernels as kernels
from semgp.octomap.index import CodeIndex, require_ascending, room_for
from semgp.octomap.label_kernels import Chains
from semgp.octomap.morton import DEPTH
from semgp.parallel import slices

SLICE = 1 << 16
"""Soft labels are taken in by this many points at a time, to bound the memory that it takes."""


class VoxelLabels:
    """Mass of each class met in a voxel, and sums of colour.

    Memory follows the classes met in a voxel, not the number of classes.
    """

    def __init__(self) -> None:
        self._index = CodeIndex()
        self._chains = Chains(
            head=np.zeros(0, dtype=np.int32),
            next=np.zeros(0, dtype=np.int32),
            label=np.zeros(0, dtype=np.int32),
            mass=np.zeros(0, dtype=np.float32),
        )
        self._n_entries = 0
        self._colour = np.zeros((0, 4), dtype=np.float32)  # sums of red, green, blue, and of points

    def __len__(self) -> int:
        return len(self._index)

    @property
    def n_labelled(self) -> int:
        """Number of voxels that have classes."""
        return int(np.count_nonzero(self._chains.head))

    @property
    def labelled_codes(self) -> NDArray[np.int64]:
        """Codes of those voxels."""
        return np.asarray(self._index.codes[self._chains.head[: len(self)] > 0])

    @property
    def n_bytes(self) -> int:
        """Memory held, in bytes."""
        return self._index.n_bytes + sum(array.nbytes for array in self._chains) + self._colour.nbytes

    def add(self, codes: NDArray[np.int64], cloud: LabelledCloud) -> None:
        """Add the labels and colours of a cloud's points, given the voxel of each; some may have no label."""
        labelled = cloud.labelled
        if cloud.colours is not None:
            rows = self.add_colours(codes, cloud.colours)[labelled]
        else:
            rows = self._rows(codes[labelled])
        if cloud.labels is not None:
            self._deposit(rows, cloud.labels[labelled], np.ones(len(rows), dtype=np.float32))
        elif cloud.weights is not None:
            weights = cloud.weights[labelled]
            for part in slices(len(rows), SLICE):
                point, label = np.nonzero(weights[part])
                self._deposit(rows[part][point], label.astype(np.int32), weights[part][point, label])

    def add_colours(self, codes: NDArray[np.int64], colours: NDArray[np.uint8]) -> NDArray[np.int64]:
        """Add the colour (N, 3) of each point, given its voxel, and return the voxels' rows (N,)."""
        rows = self._rows(codes)
        self._colour = room_for(self._colour, len(self))
        kernels.add_colours(rows, colours, self._colour)
        return rows

    def probability(
        self, codes: NDArray[np.int64], n_classes: int
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return each class's share (M, C) of a voxel's mass, and where there is any (M,); elsewhere, 1 / C."""
        shares = np.zeros((len(codes), n_classes))
        kernels.fill_mass(self._index.find(codes), self._chains, shares)
        total = shares.sum(axis=1, keepdims=True)
        observed = np.asarray(total[:, 0] > 0)
        np.divide(shares, total, out=shares, where=observed[:, None])
        shares[~observed] = 1 / n_classes
        return shares, observed

    def top_class(self, codes: NDArray[np.int64]) -> NDArray[np.int32]:
        """Return the class of most mass (M,), `MISSING` where there is none."""
        top = np.empty(len(codes), dtype=np.int32)
        kernels.fill_top(self._index.find(codes), self._chains, top)
        return top

    def mean_colour(self, codes: NDArray[np.int64]) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        """Return the mean colour (M, 3) of the points of a voxel, and where there is one (M,); elsewhere, 0."""
        rows = self._index.find(codes)
        known = np.asarray((rows >= 0) & (rows < len(self._colour)))
        sums = np.zeros((len(codes), 4), dtype=np.float32)
        sums[known] = self._colour[rows[known]]
        known &= sums[:, 3] > 0
        mean = sums[:, :3] / np.maximum(sums[:, 3:], 1)
        return np.rint(mean).astype(np.uint8), known

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return arrays, voxels in the order of their codes, from which `from_arrays` makes the same labels."""
        codes = self._index.codes
        rows = np.argsort(codes)
        count = np.zeros(len(rows), dtype=np.int64)
        kernels.count_entries(rows, self._chains, count)
        labels = np.empty(count.sum(), dtype=np.int32)
        masses = np.empty(len(labels), dtype=np.float32)
        kernels.list_entries(rows, self._chains, labels, masses)
        coloured = len(self._colour) > 0
        colour = room_for(self._colour, len(rows))[rows] if coloured else self._colour
        return {
            "voxels": codes[rows],
            "voxel_classes": count,
            "class": labels,
            "mass": masses,
            "colour_sums": colour,
        }

    @classmethod
    def from_arrays(cls, n_classes: int, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the labels again from what `to_arrays` gave.

        Raises
        ------
        InputError
            Arrays that are missing, damaged or do not fit together.
        """
        codes = stored_array(arrays, "voxels", np.int64, (None,))
        count = stored_array(arrays, "voxel_classes", np.int64, (len(codes),))
        labels = stored_array(arrays, "class", np.int32, (None,))
        masses = stored_array(arrays, "mass", np.float32, (len(labels),))
        colour = stored_array(arrays, "colour_sums", np.float32, (None, 4))
        require_ascending("voxels", codes, 1 << 3 * DEPTH)
        if (count < 0).any() or (count > n_classes).any() or count.sum() != len(labels):
            raise InputError("the stored map's numbers of classes a voxel do not fit its list of classes.")
        if len(labels) and (labels.min() < 0 or labels.max() >= n_classes):
            raise InputError(f"the stored map has classes beyond its {n_classes}.")
        if not ((masses > 0) & np.isfinite(masses)).all():
            raise InputError("the stored map has masses that are not positive and finite.")
        if len(colour) not in (0, len(codes)) or not (np.isfinite(colour).all() and (colour >= 0).all()):
            raise InputError("the stored map's colours do not fit its voxels.")
        made = cls()
        made._deposit(np.repeat(made._rows(codes), count), labels, masses)
        made._colour = colour.copy()
        return made

    def trim(self) -> None:
        """Give spare memory back."""
        self._index.trim()
        head, following, label, mass = self._chains
        n, m = len(self), self._n_entries
        self._chains = Chains(head[:n].copy(), following[:m].copy(), label[:m].copy(), mass[:m].copy())
        self._colour = self._colour[: len(self)].copy()

    def _rows(self, codes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the row of each voxel; those not met before have no classes and no colour."""
        rows = self._index.add(codes)
        self._chains = self._chains._replace(head=room_for(self._chains.head, len(self)))
        return rows

    def _deposit(self, rows: NDArray[np.int64], labels: NDArray[np.int32], masses: NDArray[np.float32]) -> None:
        """Add mass of a class to the voxels of rows."""
        done = 0
        while True:
            added, self._n_entries = kernels.deposit(
                rows[done:], labels[done:], masses[done:], self._chains, self._n_entries
            )
            done += added
            if done == len(rows):
                return
            head, following, label, mass = self._chains
            n = self._n_entries + 64
            self._chains = Chains(head, room_for(following, n), room_for(label, n), room_for(mass, n))
