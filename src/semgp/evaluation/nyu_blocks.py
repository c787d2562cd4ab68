"""The block map on the NYU frames: its models are learned from eight frames that are not scored.

Their true labels judge maps of the labels that the experiment gives: the pixels left out of the sparse grid, or
all true labels where a network's labels make the map.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from semgp.blocks.draw import Trial
from semgp.blocks.learning import learn_blocks
from semgp.blocks.model import BlockModel
from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.evaluation.measure import timed
from semgp.evaluation.nyu import METHODS, nyu_task
from semgp.evaluation.task import Built, Method, Task, of_all_solved
from semgp.gp.stationary import Matern52
from semgp.maps.gp import GPSemanticMap
from semgp.readers.nyu import ClassCount, NYUSource

LEARNING_FRAMES = (6, 150, 450, 700, 850, 1100, 1250, 1400)
"""The frames that settings are learned from, none of them the paper's."""

START: Mapping[str, BlockModel] = {
    "sparse": BlockModel(
        kernel=Matern52(ell=(0.05, 0.05, 0.05), sf=0.4) + Matern52(ell=(0.4, 0.4, 0.4), sf=0.65),
        resolution=0.008, s_n=0.002, nugget=0.01, a=0.1, delta=0.001, v_0=0.01, weights=(0.9, 0.57, 0.17),
    ),
    "noisy": BlockModel(
        kernel=Matern52(ell=(0.2,), sf=2.2),
        resolution=0.05, s_n=23.0, nugget=1.0, a=1.2, v_0=0.7, weights=(0.0, 0.27, 0.2),
    ),
    "noisy-soft": BlockModel(
        kernel=Matern52(ell=(0.1,), sf=1.0) + Matern52(ell=(1.0,), sf=1.0),
        resolution=0.05, s_n=0.1, nugget=0.1, a=0.003, weights=(0.0, 0.7, 0.0), other=True, error_rate=4.0,
    ),
}  # fmt: skip
"""Where learning starts, found on the eight frames: each label a site, or sites of five centimetres."""

_SPREAD: Mapping[str, float] = {"sparse": 1.0, "noisy": 1.0, "noisy-soft": 0.3}
_EVEN: Mapping[str, float] = {"sparse": 1.0, "noisy": 0.5, "noisy-soft": 0.5}
"""Share of the even distribution in the class prior: some classes never come up in the eight frames."""
_ITERATIONS = 15


@dataclass
class NYUBlocks:
    """Learns a block model for an experiment once, when first asked for it.

    Parameters
    ----------
    source : NYUSource
        The data set, with the eight frames.
    classes : int
        13 or 40.
    seed : int
        Seed of learning.
    """

    source: NYUSource
    classes: ClassCount = 13
    seed: int = 0
    _known: dict[str, tuple[BlockModel, float]] = field(default_factory=dict)

    def methods(self) -> dict[str, Method]:
        """Return all methods by name, `blocks` and `vote`, the same blocks without a solve, before the others."""
        return {
            "blocks": lambda task: self._built(task, "pool"),
            "vote": lambda task: self._built(task, "vote"),
            **METHODS,
        }

    def model(self, experiment: str, posterior: str = "pool") -> tuple[BlockModel, float]:
        """Return the model for an experiment, and the seconds that learning it took."""
        name = f"{experiment}, {posterior}"
        if name not in self._known:
            start = START[experiment]
            if posterior == "vote":
                start = replace(start, posterior="vote", weights=(0.0, 0.0, 0.7), error_rate=0.0, other=False)
            trials = [self._trial(frame, experiment) for frame in LEARNING_FRAMES]
            start = replace(start, prior=class_prior(trials, _EVEN[experiment]))
            self._known[name] = timed(
                lambda: learn_blocks(
                    trials, start, spread=_SPREAD[experiment], max_iterations=_ITERATIONS, seed=self.seed
                )[0]
            )
        return self._known[name]

    def _built(self, task: Task, posterior: str) -> Built:
        model, seconds = self.model(task.experiment, posterior)
        return of_all_solved(GPSemanticMap(task.truth.classes, model), task, seconds)

    def _trial(self, number: int, experiment: str) -> Trial:
        frame = self.source.read(number, self.classes)
        task = nyu_task(frame, experiment.removesuffix("-soft"), experiment.endswith("-soft"))
        judge = task.truth
        if experiment == "sparse":
            judge = _without(judge, task.training[0].labelled)
        return task.training, [judge]


def class_prior(trials: list[Trial], even: float) -> tuple[float, ...]:
    """Return the mean class frequencies of the judges' labels, mixed with an even share of each class."""
    shares = [c.class_weights.mean(axis=0, dtype=np.float64) for _, judges in trials for c in judges]
    mean = np.mean(shares, axis=0)
    return tuple((mean / mean.sum() * (1 - even) + even / len(mean)).tolist())


def _without(cloud: LabelledCloud, pixels: np.ndarray) -> LabelledCloud:
    """The cloud with the labels of some pixels missing."""
    return replace(cloud, labels=np.where(pixels, MISSING, cloud.hard_labels).astype(np.int32))
