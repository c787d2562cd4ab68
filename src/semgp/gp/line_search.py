"""Exact minimisation along a Newton step: the objectives of Laplace's approximation are convex."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

S = TypeVar("S")

LONGEST_STEP = 16.0
"""At large signal deviations full Newton steps are too short; the line search may go this much further."""
MOST_TRIALS = 20
SMALL_SLOPE = 0.1
"""A slope below this share of the first one ends the search: the next Newton step does the rest."""


def line_search(start_slope: float, at: Callable[[float], tuple[float, float, S]]) -> tuple[float, S]:
    """Minimise a convex psi(t), t > 0, by Newton's method kept inside a bracket.

    Parameters
    ----------
    start_slope : float
        psi'(0).
    at : callable
        Returns psi'(t), psi''(t) and what the caller wants to keep of t.

    Returns
    -------
    t : float
        The last step length tried, at most `LONGEST_STEP`.
    kept : object
        What `at` gave to keep there.
    """
    low, high, t = 0.0, LONGEST_STEP, 1.0
    for _ in range(MOST_TRIALS - 1):
        slope, curvature, kept = at(t)
        if abs(slope) <= SMALL_SLOPE * abs(start_slope):
            return t, kept
        low, high = (t, high) if slope < 0 else (low, t)
        t -= slope / curvature
        if not low < t < high:
            t = 0.5 * (low + high)
    return t, at(t)[2]
