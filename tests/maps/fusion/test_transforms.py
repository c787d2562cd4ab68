"""Maps in frames of their own, moved as they are fused."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.accumulate import SPREAD_UNIT
from semgp.blocks.cells import CELL
from semgp.cloud import LabelledCloud
from semgp.maps.fusion import fuse
from semgp.maps.gp import GPSemanticMap
from tests.maps.fusion.sums import FREE, SMALL, added, built, difference, held, in_frame, transform

Array = NDArray[np.float64]


class TestTransforms:
    @pytest.mark.parametrize("steps", [(0, 0, 0), (3, -1, 70), (CELL, 0, -CELL), (25_000_000, 2_500_001, 0)])
    def test_whole_voxels_are_exact(self, scans: list[LabelledCloud], steps: tuple[int, int, int]) -> None:
        b = built(scans[2:], free=FREE)
        a = built([replace(s, T_world_sensor=None) for s in scans[:2]]) if max(steps) < 1e6 else None
        T = transform(t=cast("tuple[float, float, float]", tuple(0.2 * np.array(steps))))
        fused = fuse(a or GPSemanticMap(b.classes, b.model, free=FREE), b, T)
        for prefix, found in held(fused).items():
            there = {tuple(np.add(v, steps).tolist()): sums for v, sums in held(b)[prefix].items()}
            assert found == added([held(a)[prefix] if a else {}, there])

    def test_each_site_goes_to_where_its_mean_lies(self, scans: list[LabelledCloud]) -> None:
        error = np.diag([0.01, 0.04, 0.02, 0, 0, 0])
        b = built([replace(s, pose_covariance=error) for s in scans[2:]])
        T = transform(30, (1.234, -5.0, 0.57))
        fused = fuse(GPSemanticMap(b.classes, b.model), b, T)
        found = held(fused)[""]
        want: dict[tuple[int, ...], list[Any]] = {}
        turned = np.diag(T[:3, :3] @ error[:3, :3] @ T[:3, :3].T)
        for mean, (mass, _, spread) in zip(b.positions, held(b)[""].values()):
            there = T[:3, :3] @ mean + T[:3, 3]
            members = want.setdefault(tuple(np.floor(there / 0.2).astype(int).tolist()), [])
            members.append((mass, there, spread[3]))
        assert found.keys() == want.keys()
        assert len(found) < len(b)
        for position, (voxel, (mass, _, spread)) in zip(fused.positions, found.items()):
            members = want[voxel]
            total = sum(sum(m) for m, _, _ in members)
            assert mass == np.sum([m for m, _, _ in members], axis=0).tolist()
            np.testing.assert_allclose(position, sum(sum(m) * x for m, x, _ in members) / total, rtol=0, atol=1e-7)
            np.testing.assert_allclose(np.array(spread[:3]) / total / SPREAD_UNIT, turned, atol=1e-6)
            assert spread[3] == np.bitwise_or.reduce([draws for _, _, draws in members])

    def test_robots_in_frames_of_their_own(self, scans: list[LabelledCloud]) -> None:
        T, points = transform(30, (4.3, -2.1, 0.4)), scans[1].points[::5]
        everything, a = built(scans, free=FREE), built(scans[:2], free=FREE)
        b = built([in_frame(s, T) for s in scans[2:]], free=FREE)
        change = difference(fuse(a, b, T).query(points), everything.query(points))
        assert change < 0.02
        assert change < 0.3 * difference(a.query(points), everything.query(points))
        assert change < 0.1 * difference(fuse(a, b).query(points), everything.query(points))
        in_b = in_frame(scans[1], T).points[::5]
        back = fuse(b, a, np.linalg.inv(T)).query(in_b)
        assert difference(back, built([in_frame(s, T) for s in scans]).query(in_b)) < 0.02


@pytest.mark.parametrize("make", [transform, lambda: transform(0, (0.1, 0.2, 0.3)), lambda: transform(90)])
def test_mass_is_never_lost(corner: LabelledCloud, make: Callable[[], Array]) -> None:
    a = built([corner], SMALL)
    mass = np.sum([m for m, _, _ in held(a)[""].values()], axis=0)
    fused = held(fuse(a, a, make()))[""]
    np.testing.assert_array_equal(np.sum([m for m, _, _ in fused.values()], axis=0), 2 * mass)
