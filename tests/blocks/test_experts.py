"""Blocks that solve themselves: Dirichlet targets against plain numpy, the paper's against `semgp.gp.expert`."""

from dataclasses import replace

import numpy as np
import pytest

from semgp.blocks.experts import solve_expert
from semgp.blocks.field import Field
from semgp.blocks.model import EXPERTS, BlockModel
from semgp.blocks.observations import Observations
from semgp.gp.expert import fit_expert
from semgp.gp.model import GPModel
from semgp.gp.stationary import Matern32, Matern52
from tests.blocks.naive import Array, Belief, Block, block_of, featureless, filled, pairs_of, piece_of, street

C = 4
PRIOR = np.array([0.4, 0.3, 0.2, 0.1])
MODEL = BlockModel(
    kernel=Matern52(ell=(0.4,), sf=1.2) + Matern32(ell=(2.0,), sf=0.8),
    prior=tuple(PRIOR.tolist()), leaf=18, near=6, far=6,
)  # fmt: skip


def members(seed: int, present: list[int]) -> tuple[Block, Array]:
    rng = np.random.default_rng(seed)
    mass = np.zeros((25, C))
    mass[np.arange(25), rng.choice(present, 25)] = rng.integers(1, 5, 25)
    mass[:, present] += rng.uniform(0, 0.3, (25, len(present)))
    return Block(rng.uniform(0, 2, (25, 3)), mass, rng.integers(1, 4, 25).astype(float)), rng.uniform(
        0, 2, (15, 3)
    )


def dirichlet(model: BlockModel, block: Block, Y: Array) -> Belief:
    """Class by class, absent ones too: regression of moments of log Gamma variables, from those without labels."""
    X, mass, k = block
    f, explained = np.empty((len(Y), C)), []
    for c in range(C):
        alpha, alpha_0 = mass[:, c] / k + model.a * PRIOR[c], model.a * PRIOR[c]
        s2, s2_0 = np.log(1 + 1 / alpha), np.log(1 + 1 / alpha_0)
        mean_0 = np.log(alpha_0) - s2_0 / 2
        B = np.linalg.solve(model.kernel(X, X) + np.diag(s2 + model.nugget / k), model.kernel(X, Y))
        f[:, c] = mean_0 + B.T @ (np.log(alpha) - s2 / 2 - mean_0)
        if mass[:, c].any():
            explained.append((model.kernel(X, Y) * B).sum(axis=0))
    p = np.exp(f) / np.exp(f).sum(axis=1, keepdims=True)
    return Belief(p, model.kernel.diag(Y) - np.mean(explained, axis=0))


def paper(model: BlockModel, block: Block, Y: Array) -> Belief:
    present = np.flatnonzero(block.mass.sum(axis=0) > 0)
    one_class = model.posterior == "softmax" and len(present) == 1
    inference = "laplace" if one_class else model.posterior
    gp = GPModel(kernels=(model.kernel,), inference=inference, n_inducing=None)
    shares = block.mass[:, present] / block.mass.sum(axis=1, keepdims=True)
    p, _, variance = fit_expert(gp, present, block.X, shares).predict(Y)
    never = 1 / (block.mass.sum() + C)
    all_p = np.full((len(Y), C), never)
    all_p[:, present] = p * (1 - never * (C - len(present)))
    return Belief(all_p, variance.mean(axis=1))


@pytest.mark.parametrize("present", [[0, 1, 2, 3], [1, 3], [2]], ids=str)
@pytest.mark.parametrize("posterior", EXPERTS)
def test_one_block(posterior: str, present: list[int]) -> None:
    model = replace(MODEL, posterior=posterior)
    block, Y = members(len(present), present)
    expected = (dirichlet if posterior == "dirichlet" else paper)(model, block, Y)
    found = solve_expert(model, *block, PRIOR).predict(Y)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found[0].sum(axis=1), 1, rtol=1e-12)


@pytest.mark.parametrize("counts", [(7, 2, 0, 0), (0, 0, 1, 0), (1, 1, 1, 1), (0, 300, 0, 5)], ids=str)
def test_dirichlet_targets_of_plain_counts(counts: tuple[int, ...]) -> None:
    """Milios et al. (2018), eq. 6, at the one training point: little noise, the target itself."""
    model = replace(MODEL, posterior="dirichlet", kernel=Matern52(ell=(1.0,), sf=1e4), nugget=1e-6)
    mass, origin = np.array([counts], dtype=np.float64), np.zeros((1, 3))
    p, variance = solve_expert(model, origin, mass, np.ones(1), PRIOR).predict(origin)
    alpha = mass + model.a * PRIOR
    target = np.log(alpha) - np.log(1 + 1 / alpha) / 2
    # probabilities know the targets up to what they have in common
    np.testing.assert_allclose(np.log(p / p[0, 0]), target - target[0, 0], atol=2e-5)
    noise = np.log(1 + 1 / alpha[mass > 0]) + model.nugget
    assert variance == pytest.approx(noise.mean(), rel=1e-5)


@pytest.mark.parametrize("posterior", ["dirichlet", "laplace"])
def test_field_blends_what_blocks_say(posterior: str) -> None:
    model = replace(MODEL, posterior=posterior, weights=None, blend=3.0)
    points, labels = street(0, 500, C)
    field = filled(model, points, labels, C)
    queries = np.concatenate([points[:20] + 0.03, [[900.0, 0, 0]]])
    found, pairs = field.query(queries, featureless(21)), pairs_of(field, queries, 1.5)
    expected = Belief(np.zeros((21, C)), np.zeros(21))
    for point, number, w, local in zip(pairs.point, pairs.block, pairs.weight, pairs.local):
        one = Belief(PRIOR[None], np.array([field.prior_variance]))
        if number >= 0:
            piece, place = piece_of(field, int(number))
            block = block_of(piece.solved, place, C)
            Y = local[None].astype(np.float64)
            one = (dirichlet if posterior == "dirichlet" else paper)(model, block, Y)
        for total, value in zip(expected, one):
            total[point] += w * value[0]
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, atol=2e-4 * max(1, np.abs(b).max()))
    np.testing.assert_allclose(found.probability.sum(axis=1), 1, atol=1e-5)


@pytest.mark.parametrize("posterior", EXPERTS)
def test_powers_of_a_pool_are_of_no_account(posterior: str) -> None:
    """As left over from `replace`: without data there is the prior."""
    points, labels = street(0, 100, C)
    queries = np.concatenate([points[:5], [[900.0, 0, 0]]])
    plain, left = (
        filled(replace(MODEL, posterior=posterior, weights=weights), points, labels, C)
        for weights in (None, (0.5, 2.0, 0.3))
    )
    found = left.query(queries, featureless(6)).probability
    np.testing.assert_allclose(found[-1], PRIOR, atol=1e-6)
    np.testing.assert_array_equal(found, plain.query(queries, featureless(6)).probability)


def test_blocks_are_solved_once() -> None:
    field = filled(replace(MODEL, posterior="dirichlet"), *street(1, 100, C), C)
    queries = street(1, 100, C)[0][:10]
    first = field.query(queries, featureless(10))
    experts = {(p.first, k): e for p in field.store.pieces.values() for k, e in p.experts.items()}
    second = field.query(queries, featureless(10))
    assert experts
    assert all(e is experts[p.first, k] for p in field.store.pieces.values() for k, e in p.experts.items())
    np.testing.assert_array_equal(first.probability, second.probability)


def test_unknown_features_are_those_of_the_nearest_member() -> None:
    model = replace(MODEL, posterior="dirichlet", features=("a",))
    points = np.array([[1.0, 1, 1], [1.5, 1, 1], [1.0, 1.5, 1]])
    features = np.array([[3.0], [-2.0], [0.5]], np.float32)
    field = Field(model, C)
    field.add(Observations(points, np.array([0, 1, 2], np.int32), None, features))
    unknown = field.query(points + 0.01, np.full((3, 1), np.nan, np.float32))
    known = field.query(points + 0.01, features)
    np.testing.assert_allclose(unknown.probability, known.probability, atol=1e-6)
