"""Learn a block model from labels, with other labels of the same places as the judge.

The evidence takes a network's errors for signal, for they are correlated in space. Scans taken later, from
elsewhere, err otherwise: what the model predicts at their points, from the labels of the rest, is compared with
theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from semgp.blocks.arrays import F64
from semgp.blocks.draw import Trial, draw_patches
from semgp.blocks.model import BlockModel
from semgp.blocks.objective import Objective, Progress, all_free, temperature_free
from semgp.blocks.patches import Patch
from semgp.cloud import LabelledCloud
from semgp.errors import InputError

_HALVES, _FOLDS = 2, 5
_TEMPERATURE_STEPS = 8


@dataclass(frozen=True)
class LearnedBlocks:
    """How a search went.

    Parameters
    ----------
    log_loss, start_log_loss : float
        Mean log-loss of the judges' labels, nats, after learning and before.
    patches : int
        Blocks that it was measured on.
    iterations : int
        Steps of the search.
    """

    log_loss: float
    start_log_loss: float
    patches: int
    iterations: int


def learn_from_scans(
    scans: Sequence[LabelledCloud],
    start: BlockModel,
    *,
    vertical: int | None = 2,
    patches: int = 400,
    spread: float = 0.7,
    max_iterations: int = 10,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[BlockModel, LearnedBlocks]:
    """Return a model for labels of the kind that a sequence of scans has, and how the search went.

    Kernel, noise and link are learned with each half of the sequence judging a map of the other: the farther apart
    the scans, the less they err alike. A map of half the scans is less sure than one of all of them: how sure to
    be, one common factor of the pool's powers, is set afterwards, with every fifth scan judging a map of the rest.

    Parameters
    ----------
    scans : sequence of LabelledCloud
        Two or more, in the order in which they were taken.
    start : BlockModel
        Where the search starts, and the centre of the prior. Its sizes, resolution and posterior are kept; its
        class prior is replaced by the frequencies among the scans' labels.
    vertical : int or None, optional
        Axis of gravity; the other two share their length scales. None: each axis has its own.
    patches, spread, max_iterations, seed, progress
        See `learn_blocks`.

    Raises
    ------
    InputError
        Fewer than two scans with labels, or scans that do not overlap.
    """
    scans = [cloud for cloud in scans if cloud.labelled.any()]
    if len(scans) < 2:
        raise InputError("learning from scans needs two with labels at least: one gives them, the other judges.")
    start = replace(start, prior=class_frequencies(scans))
    halves = [i * _HALVES // len(scans) for i in range(len(scans))]
    search = _Search(patches, seed, progress)
    model, _ = search(_trials(scans, halves), start, all_free(start, vertical), max_iterations, spread)
    folds = [i % _FOLDS for i in range(len(scans))]
    return search(_trials(scans, folds), model, temperature_free(model), _TEMPERATURE_STEPS, spread)


def learn_blocks(
    trials: Sequence[Trial],
    start: BlockModel,
    *,
    vertical: int | None = None,
    patches: int = 400,
    spread: float = 0.7,
    max_iterations: int = 10,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[BlockModel, LearnedBlocks]:
    """Return a model that predicts the judges' labels well, and how the search went.

    Minimises the mean log-loss over blocks drawn at random where the judges have points, plus a log-normal prior
    round the values of `start`, by L-BFGS with exact gradients.

    Parameters
    ----------
    trials : sequence of (clouds, clouds)
        Clouds that give a map its labels, and clouds that judge it. With true labels of other scenes, give the
        clouds with noisy labels and the same with true ones.
    start : BlockModel
        Where the search starts; weights of 0 stay 0. Without a class prior, it gets the labels' frequencies.
    vertical : int or None, optional
        Axis of gravity; the other two share their length scales. None: each axis has its own.
    patches : int, optional
        Blocks drawn over all trials.
    spread : float, optional
        Standard deviation of the prior of each parameter's logarithm.
    max_iterations : int, optional
        Limit of steps.
    seed : int, optional
        Seed of the draws.
    progress : callable, optional
        Called with the number of evaluations and the objective after each.

    Raises
    ------
    InputError
        Experts, which are not learned so, or no labelled point of the judges near the map.
    """
    search = _Search(patches, seed, progress)
    return search(trials, start, all_free(start, vertical), max_iterations, spread)


def class_frequencies(clouds: Sequence[LabelledCloud]) -> tuple[float, ...]:
    """Return the frequencies of the classes among the labels, with half a label more of each."""
    mass = sum(c.class_weights.sum(axis=0, dtype=np.float64) for c in clouds) + 0.5
    return tuple(np.asarray(mass / mass.sum()).tolist())


def error_frequencies(patches: Sequence[Patch], n_classes: int) -> tuple[float, ...]:
    """Return how the judges' labels fall on the classes where the nearest member's first class is another.

    Half-way to even, for classes that never come up among few errors.
    """
    wrong = np.zeros(n_classes)
    for p in patches:
        nearest = ((p.Y[:3, :, None] - p.X[:3, None, :]) ** 2).sum(axis=0).argmin(axis=1)
        named = p.present < n_classes
        if named.any():
            first = p.present[named][p.mass[named].argmax(axis=0)[nearest]]
            wrong += np.bincount(p.label[first != p.label], minlength=n_classes) / len(p.label)
    share = wrong / wrong.sum() if wrong.any() else np.full(n_classes, 1 / n_classes)
    return tuple(((share + 1 / n_classes) / 2).tolist())


@dataclass(frozen=True)
class _Search:
    """How to search: patches drawn, seed, progress."""

    patches: int
    seed: int
    progress: Progress | None

    def __call__(
        self, trials: Sequence[Trial], start: BlockModel, free: F64, max_iterations: int, spread: float
    ) -> tuple[BlockModel, LearnedBlocks]:
        if not trials or not all(training and judges for training, judges in trials):
            raise InputError("a trial needs clouds that give labels and clouds that judge them.")
        if start.prior is None:
            start = replace(start, prior=class_frequencies([c for training, _ in trials for c in training]))
        drawn = []
        for k, (training, judges) in enumerate(trials):
            rng = np.random.default_rng((self.seed, k))
            drawn += draw_patches(start, training, judges, -(-self.patches // len(trials)), rng)
        if not drawn:
            raise InputError(
                "no labelled point of the judges lies near the others' labels: nothing to learn from."
            )
        if start.error_rate > 0 and start.errors is None:
            start = replace(start, errors=error_frequencies(drawn, len(start.prior or ())))
        objective = Objective(start, drawn, free, spread, self.progress)
        x = np.zeros(free.shape[1])
        before, _ = objective(x)
        far = [(-6 * spread, 6 * spread)] * len(x)  # where the first long step cannot underflow
        found = minimize(
            objective, x, jac=True, method="L-BFGS-B", bounds=far, options={"maxiter": max_iterations}
        )
        after = float(found.fun) - objective.penalty(found.x)
        return objective.model(found.x), LearnedBlocks(after, before, len(drawn), int(found.nit))


def _trials(scans: Sequence[LabelledCloud], group: Sequence[int]) -> list[Trial]:
    """Each group of scans judges a map of the others."""
    return [
        ([c for c, g in zip(scans, group) if g != k], [c for c, g in zip(scans, group) if g == k])
        for k in dict.fromkeys(group)
    ]
