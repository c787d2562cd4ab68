"""Solve and answer: one small block against its formulas, and many blocks against each alone."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.field import Field
from semgp.blocks.linear import packed_size, unpack
from semgp.blocks.model import CLOSED, BlockModel
from semgp.blocks.observations import Observations
from semgp.gp.kernels import Kernel
from semgp.gp.stationary import Matern12, Matern32, Matern52, SquaredExponential
from tests.blocks.naive import (
    Array,
    Block,
    answer,
    blended,
    block_of,
    coefficients_of,
    covariance_and_noise,
    featureless,
    filled,
    pairs_of,
    piece_of,
    street,
    targets,
    unknown,
)

KERNELS: list[Kernel] = [
    BlockModel().kernel,
    Matern32(ell=(0.4, 0.4, 0.2), sf=1.2),
    Matern12(ell=(0.5,), sf=0.6) + SquaredExponential(ell=(0.3,), sf=0.8),
]
PRIOR = (0.4, 0.25, 0.2, 0.1, 0.05)
C = len(PRIOR)


def small_scene(model: BlockModel, classes: list[int]) -> tuple[Field, Block, Array]:
    """At most 40 sites in the middle of one cell, with soft and hard labels; points among them, one on a site."""
    rng = np.random.default_rng(len(classes))
    points = rng.uniform(1.0, 2.0, (90, 3))
    points[40:] = points[rng.integers(0, 40, 50)]  # several labels a site
    weights = np.zeros((90, C), np.float32)
    weights[:, classes] = rng.dirichlet(np.full(len(classes), 0.3), 90)
    field = Field(model, C)
    field.add(Observations(points[:60], None, weights[:60], featureless(60)))
    field.add(Observations(points[60:], rng.choice(classes, 30).astype(np.int32), None, featureless(30)))
    sites = field.sites
    block = Block(sites.positions, sites.mass / 4096, np.ones(len(sites)))
    return field, block, np.concatenate([rng.uniform(0.7, 2.3, (70, 3)), points[:3]])


@pytest.mark.parametrize("kernel", KERNELS, ids=str)
@pytest.mark.parametrize("posterior", ["pool", "indicator", "log-ratio"])
@pytest.mark.parametrize("classes", [[0, 1, 2, 3, 4], [1, 3], [2]], ids=str)
def test_one_block(kernel: Kernel, posterior: str, classes: list[int]) -> None:
    model = BlockModel(kernel=kernel, posterior=posterior, prior=PRIOR)
    field, block, points = small_scene(model, classes)
    found, expected = field.query(points, featureless(len(points))), answer(model, block, points)
    assert field.store.n_blocks == 1
    np.testing.assert_allclose(found.variance, expected.variance, atol=1e-4)
    np.testing.assert_allclose(found.probability, expected.probability, atol=2e-4)
    np.testing.assert_allclose(found.probability.sum(axis=1), 1, atol=2e-6)


@pytest.mark.parametrize("kernel", KERNELS, ids=str)
@pytest.mark.parametrize("other", [False, True])
def test_what_blocks_keep(kernel: Kernel, other: bool) -> None:
    """Coefficients are A^-1 times the targets, class by class; factors are packed rows of A's inverse factor."""
    model = BlockModel(kernel=kernel, prior=PRIOR, other=other, leaf=20, near=8, far=12)
    points, labels = street(7, 900, C)
    labels[:200] = np.arange(200) % 2
    for i in range(6):  # fewer and fewer sites, and classes, far apart from the rest
        points[30 * i : 30 * i + 30 - 5 * i] += (0, 0, 20 * (i + 1))
        labels[30 * i : 30 * i + 30 - 5 * i] = i % 3
    rows = np.zeros((900, C), np.float32)
    rows[np.arange(900), labels] = np.random.default_rng(8).uniform(0.2, 0.9, 900)
    field = Field(model, C)
    field.add(Observations(points, None, rows, featureless(900)))
    field.solve()
    checked = set()
    for piece in field.store.pieces.values():
        solved = piece.solved
        assert solved.at_factor[-1] == sum(packed_size(n) for n in solved.n) <= len(solved.factor)
        for b in range(len(solved.n)):
            block = block_of(solved, b, C + other)
            n, present = len(block.k), solved.present[b, : solved.n_present[b]]
            A, P = covariance_and_noise(model, block), len(present)
            found, factor = coefficients_of(solved, b), np.full((n, n), np.nan, np.float32)
            unpack(solved.factor[solved.at_factor[b] : solved.at_factor[b + 1]], factor)
            expected = np.linalg.inv(np.linalg.cholesky(A))
            np.testing.assert_allclose(factor, expected, atol=2e-4 * np.abs(expected).max())
            indicator, log_ratio = (np.linalg.solve(A, t) for t in targets(model, block))
            without = np.linalg.solve(A, np.log(model.a / (block.mass.sum(axis=1) + model.a)))
            for row, target in (
                (found[0], np.linalg.solve(A, np.ones(n))), (found[1], without),
                (found[2 : 2 + P], indicator[:, present].T), (found[2 + P : 2 + 2 * P], log_ratio[:, present].T),
                (found[2 + 2 * P], block.mass.sum(axis=1)), (found[3 + 2 * P :], block.mass[:, present].T),
            ):  # fmt: skip
                np.testing.assert_allclose(row, target, atol=5e-4 * max(1, np.abs(target).max()))
            checked.add((n, P))
    assert {n for n, _ in checked} >= {5, 10, 15, 40}
    assert {P - other for _, P in checked} >= {1, 4, 5}


@pytest.mark.parametrize("weights", [(2.0, 0.0, 1.0), (0.0, 1.5, 0.3), (3.0, 3.0, 3.0), (0.2, 0.1, 0.05)])
def test_pools_of_any_powers(weights: tuple[float, float, float]) -> None:
    model = BlockModel(weights=weights, prior=PRIOR, delta=0.02, v_0=0.4, a=1.5, s_n=0.6, nugget=0.05)
    field, block, points = small_scene(model, [0, 2, 4])
    found = field.query(points, featureless(len(points)))
    np.testing.assert_allclose(found.probability, answer(model, block, points).probability, atol=5e-4)


@pytest.mark.parametrize("posterior", CLOSED)
@pytest.mark.parametrize("blend", [1.0, 6.0])
def test_many_blocks(posterior: str, blend: float) -> None:
    model = BlockModel(posterior=posterior, prior=PRIOR, leaf=20, near=8, far=12, blend=blend)
    points, labels = street(0, 2500, C)
    field = filled(model, points, labels, C)
    rng = np.random.default_rng(1)
    queries = np.concatenate([points[:80] + rng.normal(scale=0.05, size=(80, 3)), rng.uniform(-4, 9, (40, 3))])
    found = field.query(queries, featureless(len(queries)))
    assert field.store.n_blocks > 80
    expected = blended(field, pairs_of(field, queries, blend / 2), len(queries), featureless(len(queries)))
    np.testing.assert_allclose(found.probability, expected.probability, atol=3e-4)
    np.testing.assert_allclose(found.probability.sum(axis=1), 1, atol=5e-6)
    np.testing.assert_allclose(found.variance, expected.variance, atol=2e-4)


def test_far_away_the_prior_is_all_there_is() -> None:
    model = BlockModel(prior=PRIOR)
    field = filled(model, *street(0, 200, C), C)
    far = np.array([[300.0, 0, 0], [1e7, -1e7, 0], [1e300, 0, 0]])
    found = field.query(far, featureless(3))
    expected = np.array(PRIOR) ** 0.95  # the powers of the pool add up to that
    np.testing.assert_allclose(found.probability, np.tile(expected / expected.sum(), (3, 1)), atol=1e-6)
    np.testing.assert_allclose(found.probability, np.tile(unknown(model, C), (3, 1)), atol=1e-6)
    np.testing.assert_allclose(found.variance, field.prior_variance, rtol=1e-6)


@pytest.mark.parametrize("posterior", ["indicator", "log-ratio", "vote"])
def test_far_from_a_block_s_members_the_prior_is_all_there_is(posterior: str) -> None:
    model = BlockModel(kernel=Matern52(ell=(0.05,), sf=0.7), posterior=posterior, prior=PRIOR)
    field = filled(model, np.array([[0.3, 0.3, 0.3]]), np.array([1], np.int32), C)
    found = field.query(np.array([[2.5, 2.5, 2.5]]), featureless(1))
    np.testing.assert_allclose(found.probability[0], PRIOR, atol=1e-5)
    np.testing.assert_allclose(found.variance, field.prior_variance, rtol=1e-5)


@pytest.mark.parametrize("classes", [[0, 1, 2, 3, 4], [1, 3]], ids=str)
def test_vote_alone(classes: list[int]) -> None:
    model = BlockModel(posterior="vote", prior=PRIOR)
    field, block, points = small_scene(model, classes)
    found = field.query(points, featureless(len(points)))
    vote = model.kernel(points, block.X) @ block.mass
    share = vote + model.v_0 * np.array(PRIOR)
    np.testing.assert_allclose(found.probability, share / share.sum(axis=1, keepdims=True), atol=1e-5)
    variance = field.prior_variance * model.v_0 / (model.v_0 + vote.sum(axis=1))
    np.testing.assert_allclose(found.variance, variance, rtol=1e-4)


def test_a_vote_has_nothing_of_what_memory_held_before() -> None:
    """Rows that a vote does not solve are zero, and have no say."""
    points = np.array([[0.1, 0.1, 0.1], [0.3, 0.1, 0.1]])
    for _ in range(10):  # leaves memory of the right size full of other numbers
        filled(BlockModel(), points, _two(), 2).solve()
    field = filled(BlockModel(posterior="vote"), points, _two(), 2)
    found = field.query(points, featureless(2))
    (piece,) = field.store.pieces.values()
    unsolved = piece.solved.coefficients.reshape(3 + 3 * 2, 2)[: 2 + 2 * 2]
    np.testing.assert_array_equal(unsolved, 0)
    assert piece.solved.at_factor.tolist() == [0, 0]
    K = field.model.kernel(points, points)
    share = K + field.model.v_0 / 2
    np.testing.assert_allclose(found.probability, share / share.sum(axis=1, keepdims=True), atol=1e-6)


def _two() -> NDArray[np.int32]:
    return np.array([0, 1], dtype=np.int32)


class TestFeatures:
    model = BlockModel(
        kernel=Matern52(ell=(0.5,), sf=0.8, dims=(0, 1, 2)) + Matern32(ell=(0.4, 0.4, 0.4, 1.0, 2.0), sf=0.6),
        features=("a", "b"), leaf=20, near=6, far=8,
    )  # fmt: skip

    def field(self) -> tuple[Field, Array]:
        points, labels = street(2, 700, 3)
        features = np.random.default_rng(3).normal(size=(700, 2)).astype(np.float32)
        field = Field(self.model, 3)
        field.add(Observations(points, labels, None, features))
        return field, points[:60] + 0.01

    def test_answers_follow_them(self) -> None:
        field, points = self.field()
        features = np.random.default_rng(4).normal(size=(60, 2)).astype(np.float32)
        expected = blended(field, pairs_of(field, points, field.model.blend / 2), 60, features)
        found = field.query(points, features)
        np.testing.assert_allclose(found.probability, expected.probability, atol=3e-4)
        np.testing.assert_allclose(found.variance, expected.variance, atol=3e-4)
        assert np.abs(found.probability - field.query(points, features + 1).probability).max() > 0.02

    @pytest.mark.parametrize("unknown", [[0], [1], [0, 1]], ids=str)
    def test_unknown_ones_are_those_of_the_nearest_member(self, unknown: list[int]) -> None:
        field, points = self.field()
        given = np.random.default_rng(5).normal(size=(60, 2)).astype(np.float32)
        given[:, unknown] = np.nan
        found = field.query(points, given)
        pairs = pairs_of(field, points, field.model.blend / 2)
        total = np.zeros((60, 3))
        for k in range(len(pairs.point)):
            piece, b = piece_of(field, int(pairs.block[k]))
            X = piece.solved.X[b, :, : piece.solved.n[b]]
            nearest = X[3:, ((X[:3] - pairs.local[k][:, None]) ** 2).sum(axis=0).argmin()]
            features = np.where(np.isnan(given[pairs.point[k]]), nearest, given[pairs.point[k]])
            one = pairs._replace(**{name: getattr(pairs, name)[k : k + 1] for name in pairs._fields})
            total += blended(field, one, 60, np.tile(features, (60, 1)).astype(np.float32)).probability
        np.testing.assert_allclose(found.probability, total, atol=3e-4)


@pytest.mark.parametrize("noise", [1e-9, 1e-5])
def test_next_to_no_noise_still_solves(noise: float) -> None:
    """Sites as close as voxels under a long kernel: the covariance alone is singular in single precision."""
    model = replace(BlockModel(), kernel=Matern52(ell=(3.0,), sf=3.0), s_n=noise, nugget=noise)
    points, labels = street(6, 1500, 2)
    found = filled(model, points, labels, 2).query(points[:200], featureless(200))
    for value in found:
        assert np.isfinite(value).all()
    np.testing.assert_allclose(found.probability.sum(axis=1), 1, atol=1e-5)
