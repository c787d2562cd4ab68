"""Fused maps are the map of all scans: the sums of both, voxel by voxel."""

from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from semgp.blocks.model import BlockModel
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.evaluation.semantic_kitti import kitti_task
from semgp.gp.stationary import Matern52
from semgp.maps.files import load_map, save_map
from semgp.maps.free_space import FreeSpace
from semgp.maps.fusion import fuse
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.readers import SemanticKITTISequence
from tests.maps.fusion.sums import FREE, assert_same_answers, built, held, transform


class TestTheMapOfAllScans:
    @pytest.mark.parametrize("free", [None, FREE])
    @pytest.mark.parametrize("split", [slice(None, None, 2), slice(2)])
    def test_to_the_last_bit(self, scans: list[LabelledCloud], split: slice, free: FreeSpace | None) -> None:
        first = scans[split]
        a, b = built(first, free=free), built([s for s in scans if s not in first], free=free)
        b.query(scans[0].points[:100])  # asked in between
        everything, fused = built(scans, free=free), fuse(a, b)
        assert held(fused) == held(everything)
        assert len(held(fused)) == (1 if free is None else 2)
        assert_same_answers(fused, everything, scans[1].points[::5])
        assert held(fuse(b, a)) == held(everything)

    def test_neither_map_is_changed(self, scans: list[LabelledCloud]) -> None:
        a, b = built(scans[:2], free=FREE), built(scans[2:], free=FREE)
        before = held(a), held(b)
        fused = fuse(a, b, transform(20))
        fused.update(scans[0])
        assert (held(a), held(b)) == before
        a.update(scans[2])
        assert len(a) < len(fused)

    def test_it_lives_on(self, scans: list[LabelledCloud], tmp_path: Path) -> None:
        fused = fuse(built(scans[:1], free=FREE), built(scans[1:2], free=FREE))
        save_map(fused, tmp_path / "fused.semgp")
        again = cast("GPSemanticMap", load_map(tmp_path / "fused.semgp"))
        for gp_map in (fused, again):
            for scan in scans[2:]:
                gp_map.update(scan)
            assert held(gp_map) == held(built(scans, free=FREE))

    @pytest.mark.parametrize("uncertain", [(0,), (2,), (1, 2)])
    def test_uncertain_positions_on_one_side_or_both(
        self, scans: list[LabelledCloud], uncertain: tuple[int, ...]
    ) -> None:
        error = np.diag([0.01, 0.04, 0.02, 1e-6, 1e-6, 1e-5])
        seen = [replace(s, pose_covariance=error) if i in uncertain else s for i, s in enumerate(scans)]
        fused, everything = fuse(built(seen[:2]), built(seen[2:])), built(seen)
        assert held(fused) == held(everything)
        assert_same_answers(fused, everything, scans[1].points[::20])

    def test_features_and_mass_of_no_class(self, corner: LabelledCloud) -> None:
        rng = np.random.default_rng(0)
        weights = (rng.random((360, 3)) / 3).astype(np.float32)
        colours = rng.integers(0, 255, (360, 3)).astype(np.uint8)
        cloud = replace(corner, labels=None, weights=weights, colours=colours)
        model = BlockModel(Matern52((1.0, 1.0, 1.0, 0.2), 0.5), resolution=0.1, features=("red",), other=True)
        parts = [cloud[::2], cloud[1::2]]
        fused, everything = fuse(built(parts[:1], model), built(parts[1:], model)), built(parts, model)
        assert held(fused) == held(everything)
        assert_same_answers(fused, everything, corner.points)

    @pytest.mark.parametrize("free", [None, FREE])
    def test_with_an_empty_map(self, scans: list[LabelledCloud], free: FreeSpace | None) -> None:
        some, empty = built(scans[:1], free=free), GPSemanticMap(scans[0].classes, OUTDOOR_LIDAR, free=free)
        for fused in (fuse(some, empty), fuse(empty, some)):
            assert held(fused) == held(some)
            for name, array in some.to_arrays()[1].items():
                np.testing.assert_array_equal(fused.to_arrays()[1][name], array)
            assert_same_answers(fused, some, scans[0].points[::20])
        nothing = fuse(empty, empty)
        with pytest.raises(InputError, match="no labelled points"):
            nothing.query(scans[0].points)
        nothing.update(scans[0])
        assert held(nothing) == held(some)

    def test_free_space_where_both_keep_it(self, scans: list[LabelledCloud]) -> None:
        fused = fuse(built(scans[:2], free=FREE), built(scans[2:]))
        assert fused.free is None
        assert held(fused) == held(built(scans))

    def test_of_semantic_kitti(self, data_dir: Path) -> None:
        folder = data_dir / "semantickitti_08"
        if not folder.is_dir():
            pytest.skip(f"{folder} is not there")
        task = kitti_task(SemanticKITTISequence(folder, world="camera"), keep=0.05, scans=2)
        a, b = (built([scan], free=FREE) for scan in task.training)
        fused, everything = fuse(a, b), built(task.training, free=FREE)
        assert held(fused) == held(everything)
        assert_same_answers(fused, everything, task.truth.points[::100])
