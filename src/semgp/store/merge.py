"""Merging: what two writers have added to one tile."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.blocks.merging import MOST_MASS
from semgp.maps.tiles import Arrays

_SUMS = ("mass", "place", "spread")


def merged(base: Arrays, mine: Arrays, theirs: Arrays) -> Arrays:
    """Return the arrays of a tile with what both writers have added to what there was.

    Sites are sums: what has been added to one is a difference, and sums and differences of integers are exact. The
    sets of draws, in the last column of `spread`, are joined. A site that would have more mass than one can hold,
    a million labels, stays as they have it. For maps that do not forget.

    Parameters
    ----------
    base, mine, theirs : dict of str to array
        The tile before, and as each of the two has it, see `semgp.maps.tiles.cut`.
    """
    return {
        name: a for prefix in _prefixes([mine, theirs]) for name, a in _field(prefix, base, mine, theirs).items()
    }


def added(parts: Sequence[Arrays]) -> Arrays:
    """Return the arrays of a tile with what each of the parts holds, at least one."""
    return reduce(partial(merged, {}), parts)


def _prefixes(parts: Sequence[Arrays]) -> list[str]:
    return sorted({name.removesuffix("voxels") for arrays in parts for name in arrays if name.endswith("voxels")})


def _field(prefix: str, base: Arrays, mine: Arrays, theirs: Arrays) -> Arrays:
    keys = np.union1d(*(arrays.get(prefix + "voxels", np.empty(0, np.int64)) for arrays in (mine, theirs)))
    sums: Arrays = {prefix + "voxels": keys}
    for name in (prefix + what for what in _SUMS):
        if name in mine or name in theirs:
            a, b, c = (_spread_out(arrays, prefix, name, keys, mine, theirs) for arrays in (base, mine, theirs))
            sums[name] = b + c - a
            if name.endswith("spread"):
                sums[name][:, 3] = b[:, 3] | c[:, 3]
    parts = [_spread_out(a, prefix, prefix + "mass", keys, mine, theirs) for a in (base, mine, theirs)]
    before, one, other = (part.sum(axis=1, dtype=np.int64) for part in parts)
    full = one + other - before > MOST_MASS
    for name in sums.keys() - {prefix + "voxels"}:
        sums[name][full] = _spread_out(theirs, prefix, name, keys, mine, theirs)[full]
    kept = sums[prefix + "mass"].any(axis=1)  # others may have gone back to a version without some of the sites
    return {name: a[kept] for name, a in sums.items()}


def _spread_out(arrays: Arrays, prefix: str, name: str, keys: NDArray[np.int64], *like: Arrays) -> NDArray[Any]:
    """The rows of an array at the places of all keys, zeros where it has none."""
    example = next(a[name] for a in like if name in a)
    rows = np.zeros((len(keys), *example.shape[1:]), dtype=example.dtype)
    if name in arrays:
        rows[np.searchsorted(keys, arrays[prefix + "voxels"])] = arrays[name]
    return rows
