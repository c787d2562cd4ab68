"""Sums of sites joined voxel by voxel, against dictionaries of whole numbers."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.blocks.accumulate import FEATURE_UNIT, MASS_UNIT
from semgp.blocks.cells import CELL
from semgp.blocks.merging import joined
from tests.maps.fusion.sums import Voxels, added, at_most, random_sums, voxels


@given(st.integers(0, 2**32 - 1), st.lists(st.booleans(), min_size=1, max_size=4))
@settings(deadline=None, max_examples=50)
def test_joined_sums_of_voxels_that_come_up_often(seed: int, uncertain: list[bool]) -> None:
    rng = np.random.default_rng(seed)
    parts = [random_sums(rng, int(rng.integers(0, 60)), u) for u in uncertain]
    want: Voxels = {}
    for part in parts:
        spread = part.spread if len(part.spread) else np.zeros((len(part.mass), 4), np.int64)
        for v, *sums in zip(part.voxels.tolist(), part.mass.tolist(), part.place.tolist(), spread.tolist()):
            both = added([{tuple(v): sums}, {k: s for k, s in want.items() if k == tuple(v)}])[tuple(v)]
            if sum(both[0]) >= 2**32:  # more than fits: the heavier stays
                both = max(want[tuple(v)], sums, key=lambda s: sum(s[0]))
            want[tuple(v)] = both
    arrays = joined(parts, np.array([CELL, 0, -CELL]))
    assert voxels(arrays) == want
    assert ("spread" in arrays) == any(u and len(p.mass) > 0 for u, p in zip(uncertain, parts))


def test_full_sites_never_wrap_round() -> None:
    full, more, origin = at_most(2**32 - 1), at_most(MASS_UNIT), np.zeros(3, np.int64)
    for parts in ([full, more], [more, full], [full, full]):
        (found,) = voxels(joined(parts, origin)).values()
        assert found[0] == [2**32 - 1]
        assert found[1][3] == (2**32 - 1) * 30_000 * FEATURE_UNIT
    (found,) = voxels(joined([more, more], origin)).values()
    assert found[0] == [2 * MASS_UNIT]
