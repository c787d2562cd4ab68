"""Committees: closed forms, naive loops, and maps of every kind."""

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.baselines.bki import BKIMap
from semgp.baselines.knn import KNNMap
from semgp.blocks.model import BlockModel
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.gp.kernels import Kernel
from semgp.gp.model import GPModel
from semgp.gp.stationary import Matern52
from semgp.maps.committee import Committee
from semgp.maps.free_space import FreeSpace
from semgp.maps.fusion import fuse
from semgp.maps.gp import GPSemanticMap
from semgp.maps.pooling import Weights, fuse_predictions
from semgp.maps.protocol import SemanticMap
from semgp.octomap import SemanticOctoMap
from semgp.prediction import OccupancyPrediction, Prediction

Array = NDArray[np.float64]
THREE = Classes(("floor", "wall", "table"))
MODEL = BlockModel(resolution=0.05)


def prediction(
    p: Any, observed: Any = True, variance: Any = None, occupancy: OccupancyPrediction | None = None
) -> Prediction:
    p = np.atleast_2d(p)
    seen = np.broadcast_to(observed, len(p))
    v = None if variance is None else np.broadcast_to(np.asarray(variance, float), p.shape)
    classes = Classes(tuple(f"class {c}" for c in range(p.shape[1])))
    return Prediction(classes, p, seen, variance=v, occupancy=occupancy)


def built(semantic_map: SemanticMap, *clouds: LabelledCloud) -> SemanticMap:
    for cloud in clouds:
        semantic_map.update(cloud)
    return semantic_map


class TestClosedForms:
    def test_two_gaussian_posteriors_of_independent_data(self) -> None:
        """Observations of one latent value with noise s: precisions 1 / v_0 + n / s."""
        v_0, s, n = 0.7, 0.3, (3, 11)
        halves = [prediction([0.5, 0.5], variance=1 / (1 / v_0 + k / s)) for k in n]
        fused = fuse_predictions(halves, prior_variance=v_0, weights="one")
        np.testing.assert_allclose(cast("Array", fused.variance), 1 / (1 / v_0 + sum(n) / s))

    def test_two_gaussian_processes_far_apart(self) -> None:
        """Data beyond each other's reach: the BCM is the posterior of both."""
        kernel: Kernel = Matern52((1.0,), 0.8)
        rng = np.random.default_rng(0)
        X = [rng.uniform(0, 2, (5, 3)), rng.uniform(0, 2, (5, 3)) + 200]
        queries = np.vstack([x + 0.3 for x in X])

        def variance(data: Array) -> Array:
            K, k = kernel(data, data) + 0.1 * np.eye(len(data)), kernel(queries, data)
            explained: Array = 0.64 - (k * np.linalg.solve(K, k.T).T).sum(axis=1)
            return explained[:, None]

        halves = [prediction(np.full((10, 1), 1.0), variance=variance(x)) for x in X]
        fused = fuse_predictions(halves, prior_variance=0.64, weights="one")
        np.testing.assert_allclose(cast("Array", fused.variance), variance(np.vstack(X)), rtol=1e-9)

    def test_likelihoods_over_one_prior(self) -> None:
        rng = np.random.default_rng(1)
        prior, likelihoods = np.array([0.5, 0.3, 0.2]), rng.random((4, 20, 3))
        posteriors = prior * likelihoods
        posteriors /= posteriors.sum(axis=2, keepdims=True)
        both = prior * likelihoods.prod(axis=0)
        fused = fuse_predictions([prediction(p) for p in posteriors], prior=7 * prior, weights="one")
        np.testing.assert_allclose(fused.probability, both / both.sum(axis=1, keepdims=True))

    def test_independent_occupancies(self) -> None:
        q_0, likelihood = 0.3, np.array([[2.0, 0.1, 7.0], [3.0, 0.5, 0.2]])  # ratios of occupied to free
        odds = q_0 / (1 - q_0) * likelihood
        known = np.ones(3, dtype=bool)
        halves = [
            prediction(np.full((3, 2), 0.5), occupancy=OccupancyPrediction(o / (1 + o), known)) for o in odds
        ]
        fused = fuse_predictions(halves, prior_occupancy=q_0, weights="one").occupancy
        assert fused is not None
        both = q_0 / (1 - q_0) * likelihood.prod(axis=0)
        np.testing.assert_allclose(fused.probability, both / (1 + both))


def naive(predictions: list[Prediction], prior: Array, v_0: Array | None) -> tuple[Array, Array]:
    """Robust weights (K, M) and probabilities (M, C), number by number."""
    K, M, C = len(predictions), len(predictions[0]), len(prior)
    weights, rows = np.zeros((K, M)), np.zeros((M, C))
    for m in range(M):
        for k, p in enumerate(predictions):
            if p.observed[m] and v_0 is not None and p.variance is not None:
                learned = [math.log(v_0[k, c] / min(p.variance[m, c], v_0[k, c])) / 2 for c in range(C)]
                weights[k, m] = sum(learned) / C
            elif p.observed[m]:
                q = p.probability[m]
                weights[k, m] = sum(q[c] * math.log(q[c] / prior[c]) for c in range(C) if q[c] > 0)
        if weights[:, m].sum() == 0:
            weights[:, m] = [p.observed[m] for p in predictions]
        weights[:, m] /= weights[:, m].sum() or 1
        for c in range(C):
            rows[m, c] = prior[c] ** (1 - weights[:, m].sum())
            for k, p in enumerate(predictions):
                rows[m, c] *= p.probability[m, c] ** weights[k, m]
        rows[m] /= rows[m].sum()
    return weights, rows


@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.booleans())
@settings(deadline=None, max_examples=100)
def test_robust_weights(seed: int, K: int, with_variances: bool) -> None:
    rng = np.random.default_rng(seed)
    M, C = 12, int(rng.integers(1, 5))
    prior = rng.dirichlet(np.ones(C))
    v_0 = np.repeat(rng.uniform(0.5, 2, (1, C)), K, axis=0)
    answers = [
        prediction(rng.dirichlet(np.ones(C), M), rng.random(M) < 0.7, rng.uniform(0.01, 1.1, (M, C)) * v_0[0])
        for _ in range(K)
    ]
    fused = fuse_predictions(answers, prior=prior, prior_variance=v_0 if with_variances else None)
    weights, rows = naive(answers, prior, v_0 if with_variances else None)
    np.testing.assert_allclose(fused.probability, rows, rtol=1e-6)
    np.testing.assert_array_equal(fused.observed, np.any([a.observed for a in answers], axis=0))
    assert (fused.variance is not None) == with_variances
    if fused.variance is not None:
        v = [np.minimum(cast("Array", a.variance), v_0[0]) for a in answers]
        precision = (1 - weights.sum(axis=0))[:, None] / v_0[0]
        precision = precision + sum(weights[k][:, None] / v[k] for k in range(K))
        np.testing.assert_allclose(fused.variance, 1 / precision)


class TestFusePredictions:
    @pytest.mark.parametrize("weights", ["robust", "one"])
    @pytest.mark.parametrize("prior_variance", [None, 1.0])
    def test_one_answer_alone_stays_as_it_is(self, weights: Weights, prior_variance: float | None) -> None:
        alone = prediction([[0.7, 0.2, 0.1], [0.2, 0.2, 0.6]], variance=[[0.3], [1.0]])
        silent = prediction([[0.1, 0.1, 0.8]] * 2, observed=False, variance=0.01)
        for answers in ([alone], [alone, silent], [silent, alone, silent]):
            fused = fuse_predictions(answers, prior=[1, 2, 3], prior_variance=prior_variance, weights=weights)
            np.testing.assert_allclose(fused.probability, alone.probability)
            assert fused.observed.all()
            if fused.variance is not None:
                np.testing.assert_allclose(fused.variance, cast("Array", alone.variance))

    @pytest.mark.parametrize("weights", ["robust", "one"])
    def test_nobody_has_observed_it(self, weights: Weights) -> None:
        unknown = OccupancyPrediction(np.array([0.9]), np.array([False]))
        silent = prediction([[0.1, 0.9]], observed=False, variance=0.1, occupancy=unknown)
        fused = fuse_predictions(
            [silent, silent], prior=[3, 1], prior_variance=2.0, prior_occupancy=0.25, weights=weights
        )
        np.testing.assert_allclose(fused.probability, [[0.75, 0.25]])
        np.testing.assert_allclose(cast("Array", fused.variance), 2.0)
        assert not fused.observed.any()
        assert fused.label.tolist() == [-1]
        assert fused.occupancy is not None
        np.testing.assert_allclose(fused.occupancy.probability, [0.25])
        assert fused.occupancy.state.tolist() == [-1]

    def test_agreement_makes_sure_only_if_data_are_independent(self) -> None:
        answer = prediction([[0.8, 0.2]], variance=0.1)
        once = fuse_predictions([answer] * 3, prior_variance=1.0)
        thrice = fuse_predictions([answer] * 3, prior_variance=1.0, weights="one")
        np.testing.assert_allclose(once.probability, answer.probability)
        np.testing.assert_allclose(thrice.probability, [[0.8**3 / (0.8**3 + 0.2**3), 0.2**3 / (0.8**3 + 0.2**3)]])
        assert once.variance is not None
        assert thrice.variance is not None
        assert thrice.variance[0, 0] < once.variance[0, 0] == pytest.approx(0.1)

    def test_who_knows_more_decides(self) -> None:
        sure, unsure = prediction([[0.7, 0.3]], variance=0.1), prediction([[0.1, 0.9]], variance=0.85)
        assert fuse_predictions([sure, unsure], prior_variance=1.0).label.tolist() == [0]
        assert fuse_predictions([sure, unsure], prior_variance=1.0, weights="one").label.tolist() == [1]
        flat = prediction([[0.45, 0.55]])
        assert fuse_predictions([sure, flat]).label.tolist() == [0]

    @pytest.mark.parametrize("weights", ["robust", "one"])
    def test_certainties_that_contradict_each_other(self, weights: Weights) -> None:
        zero, one = prediction([[1.0, 0.0]], variance=0.0), prediction([[0.0, 1.0]], variance=0.0)
        fused = fuse_predictions([zero, one], prior_variance=1.0, weights=weights)
        np.testing.assert_allclose(fused.probability, 0.5)
        np.testing.assert_allclose(cast("Array", fused.variance), 0.0, atol=1e-11)

    def test_variances_of_different_priors_give_weights_but_no_variance(self) -> None:
        sure, unsure = prediction([[0.7, 0.3]], variance=1.0), prediction([[0.1, 0.9]], variance=0.9)
        fused = fuse_predictions([sure, unsure], prior_variance=[[10.0], [1.0]])
        assert fused.variance is None
        assert fused.label.tolist() == [0]

    def test_nothing_asked(self) -> None:
        assert len(fuse_predictions([prediction(np.empty((0, 3)))] * 2)) == 0

    @pytest.mark.parametrize(
        ("answers", "how", "message"),
        [
            ([], {}, "one member at least"),
            ([prediction([0.5, 0.5]), prediction([0.2, 0.3, 0.5])], {}, "classes differ"),
            ([prediction([0.5, 0.5]), prediction([[0.5, 0.5]] * 2)], {}, r"same points, not at \[1, 2\]"),
            ([prediction([0.5, 0.5])], {"weights": "two"}, "'robust' or 'one', not 'two'"),
            ([prediction([0.5, 0.5])], {"prior": [0.5, 0.0]}, "prior must be positive"),
            ([prediction([0.5, 0.5])], {"prior": [1, 1, 1]}, r"prior must .* shape \(2,\), not \(3,\)"),
            ([prediction([0.5, 0.5])], {"prior_variance": math.nan}, "prior_variance must be positive and finite"),
            ([prediction([0.5, 0.5])], {"prior_variance": np.ones((3, 2))}, r"shape \(1, 2\), not \(3, 2\)"),
            ([prediction([0.5, 0.5])], {"prior_variance": "much"}, "array of numbers"),
        ],
    )
    def test_bad_input(self, answers: list[Prediction], how: dict[str, Any], message: str) -> None:
        with pytest.raises(InputError, match=message):
            fuse_predictions(answers, **how)

    @pytest.mark.parametrize("prior", [0.0, 1.0, math.nan])
    def test_bad_prior_of_occupancy(self, prior: float) -> None:
        known = OccupancyPrediction(np.array([0.9]), np.array([True]))
        with pytest.raises(InputError, match="prior_occupancy"):
            fuse_predictions([prediction([0.5, 0.5], occupancy=known)], prior_occupancy=prior)


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
