"""Answers of several maps at the same points, combined: the Bayesian committee machine's arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import rel_entr, softmax

from semgp.checks import as_array
from semgp.classes import Classes
from semgp.errors import InputError
from semgp.maps.protocol import SemanticMap
from semgp.parallel import parallel_map, slices
from semgp.prediction import OccupancyPrediction, Prediction

Array = NDArray[np.float64]
Answers = Sequence[NDArray[np.floating]]
Weights = Literal["robust", "one"]

FLOOR = 1e-12
"""Probabilities below count as this, variances below this share of the prior's as that: nobody is certain."""

_CHUNK = 4_096  # points that one thread combines at a time


def fuse_predictions(
    predictions: Sequence[Prediction],
    *,
    prior: ArrayLike | None = None,
    prior_variance: ArrayLike | None = None,
    prior_occupancy: float = 0.5,
    weights: Weights = "robust",
) -> Prediction:
    """Combine K answers at the same M points, each from data of its own.

    With b_k the weight of answer k at a point, 0 where it has not observed the point,

        p ~ prior^(1 - sum_k b_k) prod_k p_k^b_k,    1 / v = (1 - sum_k b_k) / v_prior + sum_k b_k / v_k.

    With all weights one this is the Bayesian committee machine (Tresp, 2000): exact where the data are independent
    given what they are about. Labels of one network are not; it errs in the same places, and counts as if surer
    with each answer. The robust weights (Deisenroth and Ng, 2015) say how much answer k has learned at the point:
    the mean over the classes of log(v_prior / v_k) / 2, or without variances the relative entropy of p_k to the
    prior. They are divided by their sum: who knows more decides, one answer alone stays as it is, and many that
    agree are as sure as one.

    Parameters
    ----------
    predictions : sequence of Prediction
        Answers at the same points, of the same classes.
    prior : (C,) array, optional
        Class probabilities without data; left out, all classes alike.
    prior_variance : float, (C,) or (K, C) array, optional
        Variance without data, of all answers or of each. Variances are combined where it is given, the same for
        all, and all answers have some.
    prior_occupancy : float, optional
        Probability without data that something is there. Occupancies are combined in the same way, in log-odds and
        weighted by entropies, where all answers have them.
    weights : "robust" or "one", optional
        See above.

    Raises
    ------
    InputError
        No predictions, classes or lengths that differ, priors out of range, or other weights.

    Notes
    -----
    Maps of two halves of ten SemanticKITTI scans, labelled by one network: with robust weights the log-loss is
    0.38, with weights of one 0.55. The map of all scans has 0.37, the halves alone 0.37 to 0.45.
    """
    classes = common_classes(predictions)
    if len({len(p) for p in predictions}) > 1:
        raise InputError(f"predictions must be at the same points, not at {[len(p) for p in predictions]}.")
    require_weights(weights)
    K, C = len(predictions), len(classes)
    p_0 = _positive("prior", 1.0 if prior is None else prior, (C,))
    p_0 = p_0 / p_0.sum()
    observed = np.stack([p.observed for p in predictions])
    variances = [p.variance for p in predictions if p.variance is not None]
    v_0 = None if prior_variance is None else _positive("prior_variance", prior_variance, (K, C))
    if len(variances) < K:
        v_0 = None
    probability = np.empty((len(predictions[0]), C))
    variance = None
    if v_0 is not None and np.allclose(v_0, v_0[0], rtol=1e-6, atol=0):
        variance = np.empty_like(probability)

    def run(rows: slice) -> None:
        answers = [np.maximum(p.probability[rows], FLOOR) for p in predictions]
        left = None
        if v_0 is not None:
            left = np.clip(np.stack([v[rows] for v in variances]) / v_0[:, None], FLOOR, 1)
        b = _weights(weights, answers, p_0, observed[:, rows], left)
        probability[rows] = _pooled(answers, p_0, b)
        if variance is not None and left is not None and v_0 is not None:
            variance[rows] = v_0[0] / (1 + (b[:, :, None] * (1 / left - 1)).sum(axis=0))

    parallel_map(run, slices(len(probability), _CHUNK))
    known = np.logical_or.reduce(observed)
    occupancy = _fused_occupancy(predictions, prior_occupancy, weights)
    return Prediction(classes, probability, known, variance=variance, occupancy=occupancy)


def _fused_occupancy(
    predictions: Sequence[Prediction], prior: float, weights: Weights
) -> OccupancyPrediction | None:
    """The combined occupancies, None where one answer has none."""
    given = [p.occupancy for p in predictions if p.occupancy is not None]
    if len(given) < len(predictions):
        return None
    if not 0 < prior < 1:
        raise InputError(f"prior_occupancy is a probability, above 0 and below 1, not {prior}.")
    q_0 = np.array([1 - prior, prior])
    answers = [np.maximum(np.column_stack([1 - o.probability, o.probability]), FLOOR) for o in given]
    known = np.stack([o.known for o in given])
    q = _pooled(answers, q_0, _weights(weights, answers, q_0, known))
    return OccupancyPrediction(q[:, 1], np.logical_or.reduce(known))


def _pooled(answers: Answers, prior: Array, b: Array) -> Array:
    """Probabilities (M, C) from K answers (M, C), their prior (C,) and weights (K, M)."""
    log_p = (1 - b.sum(axis=0))[:, None] * np.log(prior)
    for p, weight in zip(answers, b):
        log_p += weight[:, None] * np.log(p)
    return np.asarray(softmax(log_p, axis=1))


def _weights(
    weights: Weights, answers: Answers, prior: Array, observed: NDArray[np.bool_], left: Array | None = None
) -> Array:
    """Weights (K, M), given the shares of the prior variances that are left (K, M, C), if there are any."""
    if weights == "one":
        return observed.astype(np.float64)
    if left is None:
        learned = np.stack([rel_entr(p, prior).sum(axis=1) for p in answers])
    else:
        learned = -np.log(left).mean(axis=2) / 2
    share = np.maximum(learned, 0) * observed
    share = np.where(share.sum(axis=0) > 0, share, observed)
    return np.asarray(share / np.maximum(share.sum(axis=0), np.finfo(np.float64).tiny))


def _positive(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Positive numbers of a shape, or fewer that fill it."""
    a = as_array(name, value, np.float64)
    if not (np.isfinite(a) & (a > 0)).all():
        raise InputError(f"{name} must be positive and finite.")
    try:
        return np.array(np.broadcast_to(a, shape))
    except ValueError as error:
        raise InputError(f"{name} must be one number or have shape {shape}, not {a.shape}.") from error


def require_weights(weights: str) -> None:
    """Raise InputError for weights that do not exist."""
    if weights not in ("robust", "one"):
        raise InputError(f"weights must be 'robust' or 'one', not {weights!r}.")


def common_classes(members: Sequence[SemanticMap] | Sequence[Prediction]) -> Classes:
    """Return the classes of maps or predictions; InputError where they differ, or there are none."""
    if not members:
        raise InputError("a committee needs one member at least.")
    classes = members[0].classes
    for other in members[1:]:
        if other.classes.names != classes.names:
            raise InputError(
                f"the members' classes differ: {', '.join(classes.names)} and {', '.join(other.classes.names)}."
            )
    return classes
