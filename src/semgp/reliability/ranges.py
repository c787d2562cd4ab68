"""Labels count less the farther away they were taken: a law of the range, learned from how scans agree."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from scipy.special import expit

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.reliability.agreement import range_agreement, sensor_ranges
from semgp.reliability.evidence import MOST_RIGHT, evidence, probability_right
from semgp.reliability.votes import label_mass

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class RangeConfidence:
    """Confidence that falls with the distance from the sensor: floor + (1 - floor) / (1 + (r / range_0)^power).

    In a map, n labels of noise variance s^2 have s^2 / n together, and a confidence multiplies n. Without a floor
    this is noise of variance s^2 (1 + (r / range_0)^power), therefore. The power 2 is the law of a depth camera's
    random error (Khoshelham and Elberink, 2012), and of the area for which one ray stands.

    Parameters
    ----------
    range_0 : float
        Metres at which a label has lost half of what it can lose.
    power : float, optional
        How abruptly it does.
    floor : float, optional
        Confidence of the farthest labels, 0 to 1.

    Raises
    ------
    InputError
        Numbers out of range.
    """

    range_0: float
    power: float = 2.0
    floor: float = 0.0

    def __post_init__(self) -> None:
        if not (0 < self.range_0 < math.inf and 0 < self.power < math.inf):
            raise InputError(f"range_0 and power must be positive numbers, not {self.range_0} and {self.power}.")
        if not 0 <= self.floor <= 1:
            raise InputError(f"the floor must lie between 0 and 1, not {self.floor}.")

    def at(self, ranges: ArrayLike) -> F64:
        """Return the confidence at these ranges, in metres."""
        with np.errstate(over="ignore"):  # what overflows is far beyond range_0
            lost = (np.asarray(ranges, dtype=np.float64) / self.range_0) ** self.power
        return np.asarray(self.floor + (1 - self.floor) / (1 + lost))

    def apply(self, cloud: LabelledCloud) -> LabelledCloud:
        """Return the cloud with its confidence multiplied by that of its points' ranges.

        Raises
        ------
        InputError
            A cloud without a pose.
        """
        confidence = label_mass(cloud) * self.at(sensor_ranges(cloud))
        return replace(cloud, confidence=confidence.astype(np.float32))


def learn_range_confidence(scans: Sequence[LabelledCloud], *, resolution: float = 0.2) -> RangeConfidence:
    """Return the law by which labels agree with those of other scans, learned without truth.

    A label from range r is right with probability p(r), else any other of the C classes, independently given the
    truth. Two labels agree then with probability 1/C + (1 - 1/C) c(r) c(r'), where c = (C p - 1) / (C - 1) is 1
    for labels that are always right and 0 for chance. The evidence of a label, see `semgp.reliability.evidence`,
    is that of the nearest times the law of `RangeConfidence`. These four numbers are those of greatest likelihood
    of all pairs, taken as independent (a composite likelihood: Varin, Reid and Firth, 2011). One more pair for
    each bin of ranges, agreeing as all do, keeps the law flat where nothing is known.

    Parameters
    ----------
    scans, resolution
        See `semgp.reliability.agreement.range_agreement`.

    Raises
    ------
    InputError
        See there.
    """
    found = range_agreement(scans, resolution=resolution)
    C, r = found.n_classes, found.ranges
    overall = (found.agreeing.sum() + 0.5) / (found.pairs.sum() + 1)
    agreeing, pairs = found.agreeing + overall / len(r), found.pairs + 1 / len(r)

    def law(x: F64) -> RangeConfidence:
        return RangeConfidence(math.exp(x[0]), math.exp(x[1]), float(expit(x[2])))

    def loss(x: F64) -> float:
        p = probability_right(math.exp(x[3]) * law(x).at(r), C)
        c = (C * p - 1) / (C - 1)
        q = 1 / C + (1 - 1 / C) * np.outer(c, c)
        return float(-(agreeing * np.log(q) + (pairs - agreeing) * np.log1p(-q)).sum() / pairs.sum())

    most = float(evidence(MOST_RIGHT, C))
    bounds = [(math.log(r[0] / 2), math.log(100 * r[-1])), (math.log(0.5), math.log(8)), (-7, 7)]
    bounds += [(math.log(0.01 * most), math.log(most))]
    start = np.array([np.log(r).mean(), math.log(2), 0, math.log(most / 2)])
    return law(minimize(loss, start, method="L-BFGS-B", bounds=bounds).x)
