"""The block map's formulas in double precision and plain numpy, and the scenes that its tests share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgp.blocks.field import Field
from semgp.blocks.model import BlockModel
from semgp.blocks.observations import Observations
from semgp.blocks.pairs import Pairs, find_pairs
from semgp.blocks.patches import patch
from semgp.blocks.solve import JITTER
from semgp.blocks.solved import SHARED, Solved
from semgp.blocks.store import Piece
from semgp.voxels import AXIS_BITS, HALF_RANGE

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Block(NamedTuple):
    """Members of a block: inputs X (n, D), class mass (n, C) or (n, C + 1), sites joined k (n,)."""

    X: Array
    mass: Array
    k: Array


class Belief(NamedTuple):
    """Probability (m, C) and variance (m,)."""

    probability: Array
    variance: Array


def featureless(n: int) -> NDArray[np.float32]:
    return np.zeros((n, 0), dtype=np.float32)


def filled(model: BlockModel, points: Array, labels: NDArray[np.int32], n_classes: int) -> Field:
    field = Field(model, n_classes)
    field.add(Observations(points, labels, None, featureless(len(points))))
    return field


def street(seed: int, n: int, n_classes: int) -> tuple[Array, NDArray[np.int32]]:
    """A rough ground over four cells of 0.05 m voxels, with labels in stripes and some at random."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(1.2, 5.2, (n, 2)), rng.normal(1.6, 0.05, n)])
    stripes = (points[:, 0] * 2).astype(int) % n_classes
    return points, np.where(rng.random(n) < 0.2, rng.integers(0, n_classes, n), stripes).astype(np.int32)


def block_of(solved: Solved, b: int, n_classes: int) -> Block:
    nothing = np.empty((0, solved.X.shape[1]), np.float32)
    found = patch(solved, b, nothing, np.empty((0, 3), np.float32), np.empty(0, np.int32))
    mass = np.zeros((len(found.k), n_classes))
    mass[:, found.present] = found.mass.T
    return Block(found.X.T.astype(np.float64), mass, found.k.astype(np.float64))


def piece_of(field: Field, number: int) -> tuple[Piece, int]:
    """The piece that holds a block, and the block's place there."""
    [(piece, _, place)] = field.store.by_piece(np.array([number]))
    assert piece is not None
    return piece, int(place[0])


def pairs_of(field: Field, points: Array, half: float) -> Pairs:
    """All pairs of points at once, the cells round about solved first."""
    field._solve_round(points, half, 0.0)
    assert field.sites.origin is not None
    origin, trees = field.sites.origin.astype(np.float64), field.store.trees(field.sites.cells)
    return find_pairs(points, np.arange(len(points)), field.sites.resolution, origin, half, trees)


def coefficients_of(solved: Solved, b: int) -> NDArray[np.float32]:
    """The rows (3 + 3 P, n) of a block."""
    n, P = int(solved.n[b]), int(solved.n_present[b])
    return solved.coefficients[solved.at[b] : solved.at[b + 1]].reshape(SHARED + 3 * P, n)


def covariance_and_noise(model: BlockModel, block: Block) -> Array:
    """The matrix A (n, n) of a block."""
    noise = model.s_n / block.mass.sum(axis=1) + model.nugget / block.k
    jitter = JITTER * sum(term.sf**2 for term in model.terms)
    return np.asarray(model.kernel(block.X, block.X) + np.diag(noise + jitter))


def targets(model: BlockModel, block: Block) -> tuple[Array, Array]:
    """Indicators and log-ratios (n, C) of a block's members, of all classes, with mass or without."""
    mass, n = block.mass, block.mass.sum(axis=1)[:, None]
    prior = model.class_prior(mass.shape[1] - model.other).astype(np.float64)
    return mass / n - prior, np.log((mass + model.a * prior) / (n + model.a)) - np.log(prior)


def answer(model: BlockModel, block: Block, Y: Array) -> Belief:
    """The posterior of one block at Y (m, D), formula by formula."""
    X, mass, _ = block
    C = mass.shape[1] - model.other
    prior = model.class_prior(C).astype(np.float64)
    K = model.kernel(X, Y)
    B = np.linalg.solve(covariance_and_noise(model, block), K)
    indicator, log_ratio = (B.T @ target for target in targets(model, block))
    vote = K.T @ mass
    pooled = np.ones_like(vote)
    predictors = (
        np.maximum(indicator + prior, 0) + model.delta * prior,
        prior * np.exp(log_ratio),
        vote + model.v_0 * prior,
    )
    for w, p in zip(model.powers, predictors):
        pooled *= (p / p.sum(axis=1, keepdims=True)) ** w
    variance = model.kernel.diag(Y) - (K * B).sum(axis=0)
    pooled /= pooled.sum(axis=1, keepdims=True)
    if not model.solves:
        variance = model.kernel.diag(Y) * model.v_0 / (model.v_0 + vote.sum(axis=1))
    return Belief(less_errors(model, pooled, C), variance)


def unknown(model: BlockModel, n_classes: int) -> Array:
    """Probabilities (C,) without any data: the prior to the sum of the powers."""
    pooled = model.class_prior(n_classes).astype(np.float64) ** sum(model.powers)
    return np.asarray(less_errors(model, pooled[None] / pooled.sum(), n_classes)[0])


def less_errors(model: BlockModel, pooled: Array, n_classes: int) -> Array:
    """Probabilities (m, C) of pooled ones, (m, C) or with the mass of no class (m, C + 1), less the errors."""
    nothing = pooled[:, n_classes:].sum(axis=1, keepdims=True)
    s = pooled[:, :n_classes] / (1 - nothing)
    if model.error_rate == 0:
        return np.asarray(s)
    r = np.ones(n_classes) if model.errors is None else np.asarray(model.errors)
    m = s.max(axis=1, keepdims=True)
    w = model.error_rate * ((1 - m) / m * (nothing if model.other else 1)) ** model.error_power
    return np.asarray((s + w * r / r.sum()) / (1 + w))


def blended(field: Field, pairs: Pairs, n_points: int, features: NDArray[np.float32]) -> Belief:
    """The answers of all pairs, each by `answer` from the members that its block has, added up."""
    C = field.sites.mass.shape[1] - field.model.other
    total = Belief(np.zeros((n_points, C)), np.zeros(n_points))
    without = Belief(unknown(field.model, C)[None], np.array([field.prior_variance]))
    for point, number, w, local in zip(pairs.point, pairs.block, pairs.weight, pairs.local):
        one = without
        if number >= 0:
            piece, place = piece_of(field, int(number))
            block = block_of(piece.solved, place, C + field.model.other)
            one = answer(field.model, block, np.concatenate([local, features[point]])[None].astype(np.float64))
        for sum_of, value in zip(total, one):
            sum_of[point] += w * value[0]
    return total


def leaf_boxes(
    axes: NDArray[np.int8], cuts: NDArray[np.float32], n_leaves: int, low: Array, high: Array
) -> list[tuple[Array, Array]]:
    """Lowest and highest corner of each leaf of a tree in the box from low (3,) to high (3,)."""

    def walk(first: int, last: int, low: Array, high: Array) -> list[tuple[Array, Array]]:
        if last - first == 1:
            return [(low, high)]
        half = (first + last) // 2
        axis, cut = int(axes[half - 1]), float(cuts[half - 1])
        middle_high, middle_low = high.copy(), low.copy()
        middle_high[axis] = middle_low[axis] = cut
        return walk(first, half, low, middle_high) + walk(half, last, middle_low, high)

    return walk(0, n_leaves, low, high)


def share(low: Array, high: Array, box_low: Array, box_high: Array) -> float:
    """Share of a box that lies between low (3,) and high (3,)."""
    inside = np.minimum(high, box_high) - np.maximum(low, box_low)
    return float(np.prod(np.maximum(inside, 0) / (box_high - box_low)))


def voxel_index(keys: Ints) -> Ints:
    """Voxel (V, 3) of each key, counted from the origin of the keys."""
    mask = (1 << AXIS_BITS) - 1
    return np.stack([keys >> 2 * AXIS_BITS, keys >> AXIS_BITS & mask, keys & mask], axis=1) - HALF_RANGE
