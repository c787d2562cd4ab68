"""Learn a block model from labels, with other labels of the same places as the judge.

The evidence takes a network's errors for signal, for they are correlated in space. Scans from other places err
otherwise: what the model predicts at their points, from the labels of the rest, is compared with their labels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from semgp.blocks.covariance import mixture
from semgp.blocks.field import Field
from semgp.blocks.model import BlockModel
from semgp.blocks.gradients import Gradient, add_gradient
from semgp.blocks.patches import Packed, Patch, packed, patch
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.parallel import n_workers, parallel_map

Array = NDArray[np.float64]
Trial = tuple[Sequence[LabelledCloud], Sequence[LabelledCloud]]
"""Clouds that give a map its labels, and clouds that judge it."""

_NOISE, _LINK = ("s_n", "nugget", "a"), ("delta", "v_0")


@dataclass(frozen=True)
class LearnedBlocks:
    """How a search went.

    Parameters
    ----------
    log_loss : float
        Mean log-loss of the judges' labels, nats, after learning.
    start_log_loss : float
        The same before.
    patches : int
        Blocks that it was measured on.
    iterations : int
        Steps of the search.
    """

    log_loss: float
    start_log_loss: float
    patches: int
    iterations: int


def folds(clouds: Sequence[LabelledCloud], n: int = 5, inter: bool = False) -> list[Trial]:
    """Return trials in which every n-th cloud judges a map of the others.

    Raises
    ------
    InputError
        A single cloud: nothing is left to judge by.
    """
    if len(clouds) < 2:
        raise InputError("learning needs two scans at least: one gives labels, the other judges.")
    n = min(n, len(clouds))
    if inter: return [([c for i,c in enumerate(clouds) if i%n!=k],[c for i,c in enumerate(clouds) if i%n==k]) for k in range(n)]
    return [
        ([c for i, c in enumerate(clouds) if i * n // len(clouds) != k],
         [c for i, c in enumerate(clouds) if i * n // len(clouds) == k])
        for k in range(n)
    ]


def learn_blocks(
    trials: Sequence[Trial],
    start: BlockModel | None = None,
    *,
    vertical: int | None = None,
    patches: int = 200,
    held_out: int = 32,
    spread: float = 0.7,
    max_iterations: int = 10,
    seed: int = 0,
    progress: Callable[[int, float], None] | None = None,
    link_only: bool = False,
) -> tuple[BlockModel, LearnedBlocks]:
    """Return a model that predicts the judges' labels well, and how the search went.

    Minimises the mean log-loss over blocks drawn at random, where the judges have points, plus a log-normal prior
    round the values of `start`.

    Parameters
    ----------
    trials : sequence of (clouds, clouds)
        See `folds`. With true labels of other scenes, give their clouds with noisy labels and with true ones.
    start : BlockModel, optional
        Where the search starts, and the centre of the prior. Weights of 0 stay 0.
    vertical : int, optional
        Axis of gravity: the other two then share their length scales.
    patches : int, optional
        Blocks drawn over all trials.
    held_out : int, optional
        At most so many points of the judges in each block.
    spread : float, optional
        Standard deviation of the prior of each logarithm.
    max_iterations : int, optional
        Limit of steps.
    seed : int, optional
        Seed of the draws.
    progress : callable, optional
        Called with the number of evaluations and the objective after each.

    Raises
    ------
    InputError
        No trial with labels, or none whose judges have points near the map.
    """
    start = start or BlockModel()
    start = replace(start, prior=class_frequencies([c for training, judges in trials for c in training]))
    drawn: list[Patch] = []
    for k, (training, judges) in enumerate(trials):
        rng = np.random.default_rng((seed, k))
        drawn += draw_patches(start, training, judges, -(-patches // len(trials)), held_out, rng)
    if not drawn:
        raise InputError("no labelled point of the judges lies near the others' labels: nothing to learn from.")
    objective = _Objective(start, drawn, vertical, spread, progress, link_only)
    x = np.zeros(objective.n_free)
    before, _ = objective(x)
    found = minimize(objective, x, jac=True, method="L-BFGS-B", options={"maxiter": max_iterations})
    penalty = 0.5 * float(found.x @ found.x) / (spread**2 * len(drawn))
    return objective.model(found.x), LearnedBlocks(float(found.fun) - penalty, before, len(drawn), int(found.nit))


def class_frequencies(clouds: Sequence[LabelledCloud]) -> tuple[float, ...]:
    """Return the frequencies of the classes among the labels, with half a label more of each.

    Raises
    ------
    InputError
        No cloud.
    """
    if not clouds:
        raise InputError("no cloud to learn from.")
    mass = sum(c.class_weights.sum(axis=0, dtype=np.float64) for c in clouds) + 0.5
    return tuple(np.asarray(mass / mass.sum()).tolist())


def draw_patches(
    model: BlockModel,
    training: Sequence[LabelledCloud],
    judges: Sequence[LabelledCloud],
    n: int,
    held_out: int,
    rng: np.random.Generator,
) -> list[Patch]:
    """Return the blocks of a map of the training clouds that hold n of the judges' points drawn at random."""
    field = Field(replace(model, weights=(0.0, 0.0, 1.0)), len(training[0].classes))  # unsolved: members are enough
    for cloud in training:
        field.add_cloud(cloud)
    labelled = [c[c.labelled] for c in judges]
    points = np.concatenate([c.points for c in labelled])
    labels = np.concatenate([c.hard_labels for c in labelled])
    features = np.concatenate([field.features(c) for c in labelled])
    if not len(points) or not len(field.sites):
        return []
    shuffled = rng.permutation(len(points))
    seeds = field.block_of(points[shuffled[:n]], solve=True)[0]
    block, local = field.block_of(points[shuffled])
    order = np.argsort(block, kind="stable")
    drawn = []
    for b in np.unique(seeds[seeds >= 0]):
        here = order[np.searchsorted(block[order], b) :][:held_out]
        here = here[block[here] == b]
        piece = field.piece_of(int(b))
        if len(here) and piece.solved.n[b - piece.first]:
            rows = shuffled[here]
            Y = np.concatenate([local[here], features[rows]], axis=1)
            drawn.append(patch(piece.solved, int(b - piece.first), Y.astype(np.float32), labels[rows]))
    return drawn


class _Objective:
    """Penalised log-loss and its gradient as a function of the free logarithms, relative to the start."""

    def __init__(
        self,
        start: BlockModel,
        patches: Sequence[Patch],
        vertical: int | None,
        spread: float,
        progress: Callable[[int, float], None] | None,
        link_only: bool = False,
    ) -> None:
        threads = min(n_workers(), len(patches))
        self.packs = [packed(patches[i::threads]) for i in range(threads)]
        self.start, self.n_patches, self.spread = start, len(patches), spread
        self.progress, self.evaluations = progress, 0
        self.tie = _ties(start, vertical)
        if link_only:
            self.tie = self.tie[:, :0]
        self.free = [*(_NOISE if start.solves and not link_only else ()), *_LINK]
        self.weighted = [i for i, w in enumerate(start.weights) if w > 0]
        self.n_free = self.tie.shape[1] + len(self.free) + len(self.weighted)

    def model(self, x: Array) -> BlockModel:
        """Return the model of free parameters x."""
        k, n = self.tie.shape[1], len(self.free)
        kernel = self.start.kernel.with_theta(self.start.kernel.theta + self.tie @ x[:k])
        values = {name: getattr(self.start, name) * float(np.exp(v)) for name, v in zip(self.free, x[k : k + n])}
        weights = list(self.start.weights)
        for i, v in zip(self.weighted, x[k + n :]):
            weights[i] *= float(np.exp(v))
        return replace(self.start, kernel=kernel, weights=(weights[0], weights[1], weights[2]), **values)

    def __call__(self, x: Array) -> tuple[float, Array]:
        model = self.model(x)
        D = 3 + model.n_features
        kernel, noise, link = mixture(model.kernel, D), model.noise(), model.link()

        def run(pack: Packed) -> Gradient:
            g = Gradient(np.zeros(1), np.zeros((len(kernel.kind), D + 1)), np.zeros(3), np.zeros(5))
            add_gradient(pack, D, kernel, noise, link, g)
            return g

        loss, d_kernel, d_noise, d_link = (sum(parts) for parts in zip(*parallel_map(run, self.packs)))
        by_name = dict(zip((*_NOISE, *_LINK), (*d_noise, *d_link)))
        gradient = np.concatenate([
            self.tie.T @ _of_theta(model, d_kernel),
            [by_name[name] * getattr(model, name) for name in self.free],
            [d_link[2 + i] * model.weights[i] for i in self.weighted],
        ])  # fmt: skip
        scale = self.spread**2 * self.n_patches
        value = float(loss[0]) / self.n_patches + 0.5 * float(x @ x) / scale
        self.evaluations += 1
        if self.progress:
            self.progress(self.evaluations, value)
        return value, gradient / self.n_patches + x / scale


def _of_theta(model: BlockModel, d_kernel: Array) -> Array:
    """Derivatives (Q, D + 1) by term and dimension, as those of the kernel's parameters."""
    parts = []
    for term, row in zip(model.terms, d_kernel):
        d_ell = row[:-1] if term.dims is None else row[list(term.dims)]
        parts += [d_ell.sum(keepdims=True) if len(term.ell) == 1 else d_ell, row[-1:]]
    return np.concatenate(parts)


def _ties(start: BlockModel, vertical: int | None) -> Array:
    """Return the matrix (P, n_free) from free parameters to the kernel's: columns of tied length scales are one."""
    theta = start.kernel.theta
    groups: list[list[int]] = []
    at = 0
    for term in start.terms:
        spatial = [d for d in range(len(term.ell)) if vertical is not None and len(term.ell) >= 3 and d < 3]
        level = [at + d for d in spatial if d != vertical]
        groups += [level] if level else []
        groups += [[at + d] for d in range(len(term.ell) + 1) if at + d not in level]
        at += len(term.ell) + 1
    tie = np.zeros((len(theta), len(groups)))
    for column, group in enumerate(groups):
        tie[group, column] = 1
    return tie
