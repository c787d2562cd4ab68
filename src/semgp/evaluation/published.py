"""Numbers of others that a report sets beside ours: the paper's, and rivals' measured before this package was."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from semgp.conventions import NYU13, SEMANTIC_KITTI
from semgp.evaluation.task import Result

PAPER = "Ghaffari Jadidi, Gan, Parkison, Li and Eustice (2017), tables of AUC"
PROTOTYPE = "throw-away prototypes of this project on the same data and protocol, before the package was written"
OSM_BKI = "OSM-BKI (2026), its authors' C++ code, run on the same scans"
NYU_FRAMES = ("282", "374", "555", "965")
KITTI_QUERIES = 1_149_671
"""Truly labelled points of the first ten scans of sequence 08: rows of other scans cannot be compared."""


@dataclass(frozen=True)
class Reference:
    """One row of numbers by others.

    Parameters
    ----------
    n_classes : int
        Length of the class list that was scored.
    experiment : str
        The experiment of the tasks that it goes with.
    label : str
        What the table calls it.
    source : str
        Where the numbers come from.
    method : str
        Our method that it stands below; empty where we have none like it.
    auc : mapping from task name to float, optional
        AUC_total of each scene.
    scores : mapping from score to float, optional
        Means over the scenes, under the names of a result's row: fractions, the NLL in nats.
    n_query : int, optional
        Number of points that were scored, where that tells the scene.
    """

    n_classes: int
    experiment: str
    label: str
    source: str
    method: str = ""
    auc: Mapping[str, float] = field(default_factory=dict)
    scores: Mapping[str, float] = field(default_factory=dict)
    n_query: int | None = None

    def goes_with(self, result: Result) -> bool:
        """Tell whether a result is of the same experiment, classes and scene."""
        return (
            (self.experiment, self.n_classes) == (result.experiment, len(result.scores.iou))
            and (not self.auc or result.frame in self.auc)
            and self.n_query in (None, result.scores.n_points)
        )


def _nyu(
    experiment: str, method: str, label: str, auc: tuple[float, ...], source: str = PROTOTYPE, **scores: float
) -> Reference:
    return Reference(len(NYU13), experiment, label, source, method, dict(zip(NYU_FRAMES, auc)), scores)


def _kitti(experiment: str, method: str, label: str, source: str = PROTOTYPE, **scores: float) -> Reference:
    n_classes = len(SEMANTIC_KITTI)
    return Reference(n_classes, experiment, label, source, method, scores=scores, n_query=KITTI_QUERIES)


COUNTS, BEST = "label counts of 2 cm, prototype", "best of S-BKI and 15-NN, prototype"

REFERENCES: tuple[Reference, ...] = (
    _nyu("sparse", "gpsm", "GPSM, published", (0.9624, 0.9622, 0.9675, 0.9644), PAPER),
    _nyu("sparse", "octomap", "Semantic OctoMap, published", (0.88525, 0.86251, 0.88648, 0.83569), PAPER),
    _nyu("sparse", "gpsm", "GP, softmax rule, prototype", (0.9974, 0.9988, 0.9975, 0.9994), nll=0.102, ece=0.007),
    _nyu(
        "sparse",
        "gpsm-averaged",
        "GP, the paper's rule, prototype",
        (0.9854, 0.9874, 0.9803, 0.9835),
        nll=1.22,
        ece=0.64,
    ),
    _nyu("sparse", "octomap", COUNTS, (0.8816, 0.8475, 0.8904, 0.8321)),
    _nyu("sparse", "knn", "8-NN of 5,000 labels, prototype", (0.9962, 0.9945, 0.9968, 0.9990)),
    _nyu(
        "sparse",
        "knn-all",
        "8-NN, prototype",
        (0.9994, 0.9993, 0.9995, 0.9996),
        accuracy=0.9903,
        miou=0.9716,
        nll=0.0352,
        ece=0.0084,
    ),
    _nyu("sparse", "1nn-all", "1-NN, all labels, prototype", (0.992, 0.991, 0.993, 0.995), accuracy=0.9909),
    _nyu("noisy", "gpsm", "GPSM, published", (0.7192, 0.7625, 0.7032, 0.8612), PAPER),
    _nyu("noisy", "octomap", "Semantic OctoMap, published", (0.68402, 0.73552, 0.66881, 0.77456), PAPER),
    _nyu("noisy", "octomap", COUNTS, (0.7334, 0.7813, 0.7018, 0.7451)),
    _nyu(
        "noisy",
        "knn-256",
        "256-NN, prototype",
        (0.768, 0.828, 0.727, 0.770),
        accuracy=0.676,
        miou=0.375,
        nll=2.79,
        ece=0.258,
    ),
    _nyu("noisy-soft", "", "the network's probabilities", (0.7873, 0.8913, 0.8863, 0.7910)),
    _nyu("noisy-soft", "knn-256", "256-NN, prototype", (0.8087, 0.8949, 0.8895, 0.7931)),
    _kitti("keep-1", "labels", "the network's labels, prototype", miou=0.3800, accuracy=0.8414),
    _kitti("keep-1", "csm", "prototype", miou=0.3963, accuracy=0.8624, ece=0.050, nll=0.685),
    _kitti("keep-1", "bki", "prototype", miou=0.4026, accuracy=0.8686, ece=0.033, nll=0.559),
    _kitti("keep-1", "knn", "prototype", miou=0.4044, accuracy=0.8634, ece=0.056, nll=0.702),
    _kitti("keep-1", "", "OSM-BKI, 0.3 m, ell 0.3", OSM_BKI, miou=0.3935, accuracy=0.8608),
    _kitti("keep-1", "", "OSM-BKI, 0.1 m", OSM_BKI, miou=0.3999, accuracy=0.8630),
    _kitti("keep-0.01", "", BEST, miou=0.380, accuracy=0.842, ece=0.050, nll=0.633),
    _kitti("keep-0.002", "", BEST, miou=0.346, accuracy=0.811, ece=0.119, nll=0.935),
)
"""All rows. The paper's noisy labels came from another network than the ones that we have."""
