"""What labels mean: which classes are said for which, learned from scans that contradict each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from semgp.checks import as_array
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.reliability import dawid_skene
from semgp.reliability.evidence import evidence
from semgp.reliability.votes import label_mass, scan_votes, usable_scans

_RIGHT_BEFOREHAND = 0.9


@dataclass(frozen=True, eq=False)
class Confusion:
    """How often each class is said where another is true.

    Parameters
    ----------
    classes : Classes
        The C classes.
    matrix : (C, C) array
        p(said | true): row t holds the probabilities of what is said where class t is true.
    frequencies : (C,) array
        p(true).
    log_likelihood : float, optional
        Of the votes that it was learned from, penalised by the prior, nats a vote; NaN if it was not.
    iterations : int, optional
        Steps that learning took.
    converged : bool, optional
        Whether learning ended before its limit of steps.

    Raises
    ------
    InputError
        Fewer than two classes, arrays of another shape, or rows that are no probabilities.
    """

    classes: Classes
    matrix: NDArray[np.float64]
    frequencies: NDArray[np.float64]
    log_likelihood: float = math.nan
    iterations: int = 0
    converged: bool = True

    def __post_init__(self) -> None:
        C = len(self.classes)
        if C < 2:
            raise InputError("a confusion needs two classes at least.")
        for name, shape in (("matrix", (C, C)), ("frequencies", (C,))):
            p = as_array(name, getattr(self, name), np.float64)
            if p.shape != shape or not ((p >= 0).all() and np.allclose(p.sum(axis=-1), 1)):
                raise InputError(f"{name} must hold probabilities of shape {shape}, each row summing to one.")
            object.__setattr__(self, name, p)

    @property
    def true_given_said(self) -> NDArray[np.float64]:
        """p(true | said) (C, C), row k for what is said; for a class that is never said, that class."""
        joint = self.frequencies[:, None] * self.matrix
        said = joint.sum(axis=0)
        p = np.divide(joint, said, out=np.eye(len(said)), where=said > 0)
        return np.ascontiguousarray(p.T)

    @property
    def reliability(self) -> NDArray[np.float64]:
        """p(true = c | said = c) (C,): how often a label is right."""
        return self.true_given_said.diagonal().copy()

    @property
    def class_confidence(self) -> NDArray[np.float64]:
        """How much a label of each class counts (C,): its evidence against that of the most reliable class."""
        weight = evidence(self.reliability, len(self.classes))
        most = weight.max()
        return np.asarray(weight / most) if most > 0 else np.ones(len(weight))

    def apply(self, cloud: LabelledCloud) -> LabelledCloud:
        """Return the cloud with soft labels p(true | said); those that are soft already mix the rows.

        A label keeps its mass and its confidence. A cloud without labels stays as it is.

        Raises
        ------
        InputError
            A cloud with other classes.
        """
        self._require_classes(cloud)
        if cloud.labels is None and cloud.weights is None:
            return cloud
        P = self.true_given_said.astype(np.float32)
        return replace(cloud, labels=None, weights=cloud.class_weights @ P)

    def weigh(self, cloud: LabelledCloud) -> LabelledCloud:
        """Return the cloud with its confidence multiplied by `class_confidence`, of soft labels by the mean of it.

        Raises
        ------
        InputError
            A cloud with other classes.
        """
        self._require_classes(cloud)
        weights = cloud.class_weights
        total = weights.sum(axis=1)
        mean = np.divide(weights @ self.class_confidence, total, out=np.ones(len(cloud)), where=total > 0)
        return replace(cloud, confidence=np.clip(label_mass(cloud) * mean, 0, 1).astype(np.float32))

    def _require_classes(self, cloud: LabelledCloud) -> None:
        if cloud.classes.names != self.classes.names:
            raise InputError(
                f"the cloud's classes ({', '.join(cloud.classes.names)}) are not those that the confusion was "
                f"learned for ({', '.join(self.classes.names)})."
            )


def learn_confusion(
    scans: Sequence[LabelledCloud], *, resolution: float = 0.2, iterations: int = 20, prior: float = 0.2
) -> Confusion:
    """Return the confusion of the labels of scans that see the same places, learned without truth.

    Each scan is an annotator, each voxel that two scans or more have seen an item, see `semgp.reliability.votes`;
    one confusion holds for all, and the true classes are summed out by the EM algorithm of Dawid and Skene (1979),
    see `semgp.reliability.dawid_skene`. Voxels that hold two classes look like errors: take them small.

    Soft labels count as their class of most weight.

    Parameters
    ----------
    scans : sequence of LabelledCloud
        Two or more that overlap; their confidence, if any, weighs the labels of a scan in one voxel.
    resolution : float, optional
        Edge of the voxels in metres.
    iterations : int, optional
        Limit of steps.
    prior : float, optional
        Weight of what is believed beforehand against all votes: labels are right with probability 0.9 and else any
        class, by frequency. It keeps the diagonal dominant. Without it rare classes soon come to stand for voxels
        of many classes.

    Raises
    ------
    InputError
        Classes that differ, fewer than two scans with labels, no voxel that two have seen, or numbers that are out
        of range.
    """
    if iterations < 1 or not 0 < prior < math.inf:
        raise InputError(f"iterations must be 1 at least and prior positive, not {iterations} and {prior}.")
    scans = usable_scans(scans, resolution)
    classes = scans[0].classes
    votes = scan_votes(scans, [cloud.hard_labels for cloud in scans], resolution)
    C, V = len(classes), len(votes.scans)
    N = csr_array((votes.share, (votes.voxel, votes.kind)), shape=(V, C))
    said = N.sum(axis=0) + 0.5
    by_chance = said / said.sum()
    believed = _RIGHT_BEFOREHAND * np.eye(C) + (1 - _RIGHT_BEFOREHAND) * by_chance
    beforehand = dawid_skene.Errors(prior * N.sum() / C * believed, prior * V * by_chance)
    found = dawid_skene.fit(N, beforehand, iterations)
    return Confusion(
        classes, found.errors.matrix, found.errors.frequencies, found.objective, found.iterations, found.converged
    )
