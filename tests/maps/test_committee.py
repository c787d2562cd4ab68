"""Committees of maps of every kind."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.baselines.bki import BKIMap
from semgp.baselines.knn import KNNMap
from semgp.blocks.model import BlockModel
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.gp.model import GPModel
from semgp.maps.committee import Committee
from semgp.maps.free_space import FreeSpace
from semgp.maps.fusion import fuse
from semgp.maps.gp import GPSemanticMap
from semgp.maps.pooling import Weights
from semgp.maps.protocol import SemanticMap
from semgp.octomap import SemanticOctoMap

Array = NDArray[np.float64]
THREE = Classes(("floor", "wall", "table"))
MODEL = BlockModel(resolution=0.05)


def built(semantic_map: SemanticMap, *clouds: LabelledCloud) -> SemanticMap:
    for cloud in clouds:
        semantic_map.update(cloud)
    return semantic_map


class TestCommittee:
    @pytest.mark.parametrize("weights", ["robust", "one"])
    def test_of_halves_and_the_fused_map(self, corner: LabelledCloud, weights: Weights) -> None:
        a, b = (
            cast("GPSemanticMap", built(GPSemanticMap(THREE, MODEL, free=FreeSpace(rays=500)), part))
            for part in (corner[::2], corner[1::2])
        )
        answer, fused = Committee((a, b), weights=weights).query(corner.points), fuse(a, b).query(corner.points)
        assert (answer.label == fused.label).mean() > 0.97
        np.testing.assert_array_equal(
            answer.observed, a.query(corner.points).observed | b.query(corner.points).observed
        )
        assert answer.variance is not None
        assert answer.occupancy is not None
        assert fused.occupancy is not None
        assert (answer.occupancy.state == fused.occupancy.state).mean() > 0.9
        far = Committee((a, b), weights=weights).query(corner.points[:2] + 1e4)
        np.testing.assert_allclose(far.probability, a.query(corner.points[:2] + 1e4).probability, rtol=1e-5)
        np.testing.assert_allclose(cast("Array", far.variance), prior_variance(a), rtol=1e-5)

    @pytest.mark.parametrize("weights", ["robust", "one"])
    def test_maps_of_every_kind(self, corner: LabelledCloud, weights: Weights) -> None:
        maps = [
            built(GPSemanticMap(THREE, MODEL), corner[::2]),
            built(GPSemanticMap(THREE, GPModel(n_inducing=40)), corner[1::2]),
            built(SemanticOctoMap(THREE, resolution=0.2), corner),
            built(BKIMap(THREE, resolution=0.1), corner[::3]),
            built(KNNMap(THREE), corner[1::3]),
        ]
        committee = Committee(maps, weights=weights)
        answer, known = committee.query(corner.points), corner.labelled
        np.testing.assert_allclose(answer.probability.sum(axis=1), 1)
        assert (answer.label[known] == corner.hard_labels[known]).mean() > 0.97
        assert answer.variance is None
        assert answer.occupancy is None
        assert committee.classes == THREE

    def test_the_paper_s_maps(self, corner: LabelledCloud) -> None:
        model = GPModel(n_inducing=60)
        halves = [built(GPSemanticMap(THREE, model), part) for part in (corner[::2], corner[1::2])]
        answer = Committee(halves).query(corner.points)
        known = corner.labelled
        assert (answer.label[known] == corner.hard_labels[known]).mean() > 0.95
        assert answer.variance is not None
        each = [cast("Array", m.query(corner.points).variance) for m in halves]
        assert (answer.variance <= np.maximum(*each) + 1e-6).all()

    def test_maps_in_frames_of_their_own(self, corner: LabelledCloud) -> None:
        T = np.eye(4)
        T[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
        T[:3, 3] = 5.0, -2.0, 1.0
        here = KNNMap(THREE)
        here.update(corner[::2])
        there = KNNMap(THREE)
        there.update(replace(corner[1::2], points=(corner.points[1::2] - T[:3, 3]) @ T[:3, :3]))
        same = KNNMap(THREE)
        same.update(corner[1::2])
        np.testing.assert_allclose(
            Committee((here, there), (np.eye(4), T)).query(corner.points).probability,
            Committee((here, same)).query(corner.points).probability,
            atol=1e-5,
        )

    def test_bad_input(self, corner: LabelledCloud) -> None:
        known = built(KNNMap(THREE), corner)
        with pytest.raises(InputError, match="one member at least"):
            Committee([])
        with pytest.raises(InputError, match="classes differ"):
            Committee([known, KNNMap(Classes(("road", "car")))])
        with pytest.raises(InputError, match="no labelled points"):
            Committee([known, GPSemanticMap(THREE)])
        with pytest.raises(InputError, match="2 maps need as many transforms, not 1"):
            Committee([known, known], [np.eye(4)])
        with pytest.raises(InputError, match=r"T_world_map\[1\] has NaN"):
            Committee([known, known], [np.eye(4), np.full((4, 4), np.nan)])
        with pytest.raises(InputError, match="query points"):
            Committee([known]).query([[np.nan, 0, 0]])
        with pytest.raises(InputError, match="'robust' or 'one'"):
            Committee([known], weights=cast("Any", "best"))
        assert len(Committee([known, known]).query(np.empty((0, 3)))) == 0


def prior_variance(gp_map: GPSemanticMap) -> float:
    assert isinstance(gp_map.model, BlockModel)
    return float(gp_map.model.kernel.diag(np.zeros((1, 3)))[0])
