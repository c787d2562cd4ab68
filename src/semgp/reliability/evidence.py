"""From how often labels are right to how much they count: the weight of evidence of one label.

Labels that are right with probability p and else any other of C classes, all alike, independent given the truth,
have a log-likelihood log p(labels | true = c) that is, up to a constant, the sum over the labels that say c of

    w(p) = log(p (C - 1) / (1 - p)),

so a vote with these weights is Bayes' rule (Nitzan and Paroush, 1982, for two classes; Zhu et al., 2009, weigh
the votes of SAMME so for more). w is 0 for a label by chance, p = 1/C. What counts in a map is w against that of
the best labels: a confidence from 0 to 1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

MOST_RIGHT = 0.99
"""No label counts as one that is right more often: the errors of scans are not as independent as all that, and one
perfect class would take the confidence of all others."""


def evidence(right: ArrayLike, n_classes: int) -> NDArray[np.float64]:
    """Return w(p) of labels that are right with probabilities p, at least 0, at most that of `MOST_RIGHT`."""
    p = np.clip(np.asarray(right, dtype=np.float64), 1 / (n_classes + 1), MOST_RIGHT)
    return np.maximum(np.log(p * (n_classes - 1) / (1 - p)), 0)


def probability_right(evidence: NDArray[np.float64], n_classes: int) -> NDArray[np.float64]:
    """Return the p of which w(p) is the evidence."""
    return np.asarray(1 / (1 + (n_classes - 1) * np.exp(-evidence)))
