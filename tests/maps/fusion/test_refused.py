"""Maps, models and transforms that cannot be fused."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from semgp.blocks.merging import joined, moved
from semgp.blocks.model import BlockModel
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.gp.model import GPModel
from semgp.maps.forgetting import Forgetting
from semgp.maps.fusion import fuse
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.voxels import HALF_RANGE, MARGIN
from tests.maps.fusion.sums import FREE, SMALL, at_most, built, random_sums, transform


class TestBadInput:
    @pytest.mark.parametrize("other", [None, "map.semgp", np.zeros((3, 3)), OUTDOOR_LIDAR])
    def test_no_map(self, corner: LabelledCloud, other: Any) -> None:
        gp_map = built([corner], SMALL)
        for a, b in ((gp_map, other), (other, gp_map)):
            with pytest.raises(InputError, match="only maps of a BlockModel"):
                fuse(a, b)

    def test_the_paper_s_map(self, corner: LabelledCloud) -> None:
        whole = GPSemanticMap(corner.classes, GPModel(n_inducing=20))
        with pytest.raises(InputError, match=r"b is of a GPModel.*Committee"):
            fuse(built([corner], SMALL), whole)

    def test_maps_that_forget(self, scans: list[LabelledCloud]) -> None:
        forgets = GPSemanticMap(scans[0].classes, OUTDOOR_LIDAR, free=FREE, forgetting=Forgetting(5))
        with pytest.raises(InputError, match="b forgets"):
            fuse(built(scans[:1], free=FREE), forgets)

    def test_other_classes(self, corner: LabelledCloud) -> None:
        other = GPSemanticMap(Classes(("floor", "wall", "lamp")), SMALL)
        with pytest.raises(InputError, match=r"a has floor, wall, table, b has floor, wall, lamp"):
            fuse(built([corner], SMALL), other)

    def test_models_that_differ_are_named(self, corner: LabelledCloud) -> None:
        other = built([corner], replace(SMALL, resolution=0.2, leaf=32))
        with pytest.raises(InputError, match=r"resolution \(0\.1 and 0\.2\), leaf \(64 and 32\).*model="):
            fuse(built([corner], SMALL), other)

    @pytest.mark.parametrize(
        ("model", "message"),
        [
            (GPModel(), "must be a BlockModel"),
            (replace(SMALL, other=True), "other must be those of the maps"),
            (BlockModel(features=("red",)), "features must be those"),
            (replace(SMALL, prior=(1.0, 1.0)), "2 classes, the map has 3"),
        ],
    )
    def test_models_that_do_not_fit(self, corner: LabelledCloud, model: Any, message: str) -> None:
        a = built([corner], SMALL)
        with pytest.raises(InputError, match=message):
            fuse(a, a, model=model)

    def test_experts_take_positions_as_certain(self, corner: LabelledCloud) -> None:
        uncertain = built([replace(corner, pose_covariance=np.eye(6) * 1e-4)], SMALL)
        with pytest.raises(InputError, match="dirichlet experts take positions as certain"):
            fuse(uncertain, uncertain, model=replace(SMALL, posterior="dirichlet", weights=None))

    @pytest.mark.parametrize(
        ("T", "message"),
        [
            (np.full((4, 4), np.nan), "NaN"),
            (np.eye(3), r"shape \(4, 4\)"),
            (2 * np.eye(4), "no rigid transform"),
            (np.diag([1.0, 1, -1, 1]), "no rigid transform"),
            ("turned", "array of numbers"),
            (transform(t=(1e300, 0, 0)), "too far for voxels"),
            (transform(5, t=(1e6, 0, 0)), "lie too far apart"),
            (transform(t=(1e6, 0, 0)), "lie too far apart"),
        ],
    )
    def test_transforms(self, corner: LabelledCloud, T: Any, message: str) -> None:
        a = built([corner], SMALL)
        with pytest.raises(InputError, match=message):
            fuse(a, a, T)

    def test_the_range_of_the_keys(self, corner: LabelledCloud) -> None:
        origin, rim = np.zeros(3, np.int64), HALF_RANGE - MARGIN
        assert len(joined([at_most(1, (0, -rim, 0)), at_most(1, (0, 0, rim - 1))], origin)["voxels"]) == 2
        for voxel in ((0, -rim - 1, 0), (0, 0, rim)):
            with pytest.raises(InputError, match="too far apart"):
                joined([at_most(1, voxel)], origin)
        a = built([corner], SMALL)
        T = transform(t=(9e4, -9e4, 0))
        assert len(fuse(a, a, T)) == 2 * len(a)

    def test_moved_sites_are_none_the_less_whole(self) -> None:
        empty = random_sums(np.random.default_rng(0), 0, uncertain=True)
        for T in (np.eye(4), transform(20)):
            assert moved(empty, T, 0.1, 0.2).voxels.shape == (0, 3)
