"""Tile files: the stored arrays of a tile as one zip archive of .npy files, the same bytes for the same arrays.

Rows are in ascending order of their voxels' keys, which are stored as steps from one to the next. Masses are
sparse: for each site the number of its classes, and then class and mass of each. Everything is little-endian:

================= ========= ==================================================================
`voxels`          int64     (S,) the first key, then steps; `cells` likewise, where there are times
`n_classes`       uint16    (S,) classes with mass
`class`           uint16    (M,) their labels, site by site, ascending
`mass`            uint32    (M,) their masses
`place`           int64     (S, D) sums of positions and features
`spread`          int64     (S, 4) sums of variances, and the set of draws, where positions are uncertain
`cells`, `time`   see above  when each cell was last faded, the clock last; for maps that forget
================= ========= ==================================================================

Those of free space have the prefix `free.`.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.readers.npz import DAMAGE, read_member, read_npy

Arrays = dict[str, NDArray[Any]]

_LEVEL = 1  # of compression: the sixth takes four times as long and saves a tenth
_MOST_MASSES = 1 << 30  # 4 GiB
_SLACK, _RATIO = 1 << 26, 100  # bytes that any file may unpack to, and beyond that how many a byte


def encode(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return the bytes of a tile file from the arrays of `semgp.maps.tiles.cut`."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, array in sorted(_packed(arrays).items()):
            raw = io.BytesIO()
            np.lib.format.write_array(raw, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False)
            member = zipfile.ZipInfo(f"{name}.npy")  # of 1980: the same bytes at any time
            archive.writestr(member, raw.getvalue(), zipfile.ZIP_DEFLATED, _LEVEL)
    return file.getvalue()


def decode(data: bytes, n_classes: Mapping[str, int]) -> Arrays:
    """Return the arrays in the bytes of a tile file.

    Parameters
    ----------
    data : bytes
        The file.
    n_classes : mapping of str to int
        The columns of the masses, by the prefix of a field's arrays.

    Raises
    ------
    InputError
        Bytes that are no tile file, or are damaged, or unpack to far more than they are.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            unpacked = sum(member.file_size for member in archive.infolist())
            if unpacked > _SLACK + _RATIO * len(data):
                raise InputError(f"would unpack to {unpacked:,} bytes: refused as a decompression bomb.")
            packed = {
                m.filename.removesuffix(".npy"): read_npy(read_member(archive, m)) for m in archive.infolist()
            }
        return {name: a for prefix, C in n_classes.items() for name, a in _unpacked(packed, prefix, C).items()}
    except InputError:
        raise
    except DAMAGE as error:
        raise InputError(f"is no tile file, or is damaged: {error}") from error


def _packed(arrays: Mapping[str, NDArray[Any]]) -> Arrays:
    packed: Arrays = {}
    for name, array in arrays.items():
        prefix, what = _split(name)
        if what in ("voxels", "cells"):
            packed[name] = np.diff(array, prepend=np.int64(0))
        elif what == "mass":
            rows, labels = np.nonzero(array)
            packed[prefix + "n_classes"] = np.bincount(rows, minlength=len(array)).astype(np.uint16)
            packed[prefix + "class"] = labels.astype(np.uint16)
            packed[name] = array[rows, labels]
        else:
            packed[name] = array
    return packed


def _unpacked(packed: Arrays, prefix: str, n_classes: int) -> Arrays:
    arrays = {name: a for name, a in packed.items() if _split(name)[0] == prefix}
    for name in (prefix + "voxels", prefix + "cells"):
        if name in arrays:
            if arrays[name].dtype != np.int64 or arrays[name].ndim != 1:
                raise InputError(f"is damaged: {name} of another type or shape.")
            arrays[name] = arrays[name].cumsum(dtype=np.int64)
    counts, labels = arrays.pop(prefix + "n_classes"), arrays.pop(prefix + "class")
    amounts = arrays[prefix + "mass"]
    if counts.dtype != np.uint16 or labels.dtype != np.uint16 or amounts.dtype != np.uint32:
        raise InputError("is damaged: masses of another type.")
    sites = arrays[prefix + "voxels"].shape
    if counts.shape != sites or not counts.all():
        raise InputError("is damaged: sites without masses.")
    if len(counts) * n_classes > _MOST_MASSES:
        raise InputError(f"is damaged: {len(counts):,} sites of {n_classes:,} classes are too many for a tile.")
    if not (len(labels) == len(amounts) == counts.sum()) or (labels >= n_classes).any():
        raise InputError("is damaged: masses that do not belong to its sites, or classes that the map has not.")
    mass = np.zeros((len(counts), n_classes), dtype=np.uint32)
    mass[np.repeat(np.arange(len(counts)), counts), labels] = amounts
    return arrays | {prefix + "mass": mass}


def _split(name: str) -> tuple[str, str]:
    """The prefix of a field and the name of an array in it."""
    prefix, dot, what = name.rpartition(".")
    return prefix + dot, what
