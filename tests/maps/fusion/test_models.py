"""Maps fused into one of another model."""

from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from semgp.blocks.model import BlockModel
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.free_space import FreeSpace, occupancy_model
from semgp.maps.fusion import fuse
from semgp.maps.presets import OUTDOOR_LIDAR
from tests.maps.fusion.sums import FREE, assert_same_answers, built, difference, held


class TestOtherModels:
    def test_the_same_voxels(self, scans: list[LabelledCloud]) -> None:
        other = replace(OUTDOOR_LIDAR, s_n=0.5, prior=tuple(range(1, len(scans[0].classes) + 1)))
        a, b = built(scans[:2], OUTDOOR_LIDAR), built(scans[2:], replace(OUTDOOR_LIDAR, nugget=0.2))
        fused, everything = fuse(a, b, model=other), built(scans, other)
        assert fused.model == other
        assert held(fused) == held(everything)
        assert_same_answers(fused, everything, scans[1].points[::20])

    def test_larger_voxels(self, scans: list[LabelledCloud]) -> None:
        coarse = replace(OUTDOOR_LIDAR, resolution=0.5)
        free = FreeSpace(occupancy_model(0.5), rays=2000)
        a, b = built(scans[:2], OUTDOOR_LIDAR, FREE), built(scans[2:], coarse, free)
        fused = fuse(a, b, model=coarse, free=free)
        assert fused.free == free
        masses: dict[tuple[int, ...], list[int]] = {}
        for gp_map in (a, b):
            for position, (mass, _, _) in zip(gp_map.positions, held(gp_map)[""].values()):
                key = tuple(np.floor(position / 0.5).astype(int).tolist())
                masses[key] = np.add(masses.get(key, 0), mass).tolist()
        assert {v: mass for v, (mass, _, _) in held(fused)[""].items()} == masses
        everything, points = built(scans, coarse, free), scans[1].points[::5]
        assert difference(fused.query(points), everything.query(points)) < 0.02

    def test_free_space_of_both_must_be_one_or_given(self, scans: list[LabelledCloud]) -> None:
        a, b = built(scans[:2], free=FREE), built(scans[2:], free=replace(FREE, seed=1))
        with pytest.raises(InputError, match=r"free space differ in seed \(0 and 1\)"):
            fuse(a, b)
        assert fuse(a, b, free=FREE).free == FREE
        other = replace(FREE, model=replace(cast("BlockModel", FREE.model), s_n=1.0))
        with pytest.raises(InputError, match=r"model\.s_n \(0\.13 and 1\.0\)"):
            fuse(a, built(scans[2:], free=other))
        with pytest.raises(InputError, match="voxels of another size"):
            fuse(a, b, model=replace(OUTDOOR_LIDAR, resolution=0.4))
        with pytest.raises(InputError, match="not both maps keep free space"):
            fuse(a, built(scans[2:]), free=FREE)
