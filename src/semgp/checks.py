"""Checks of arrays where they enter: behind the border nobody checks again."""

from __future__ import annotations

from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING
from semgp.errors import InputError


def rigid_transform(name: str, T: ArrayLike) -> NDArray[np.float64]:
    """Check a rigid transform, shape (4, 4), and return it as float64.

    Raises
    ------
    InputError
        Wrong shape, entries that are not finite, or a rotation part that is not a rotation.
    """
    T = as_array(name, T, np.float64)
    if T.shape != (4, 4):
        raise InputError(f"{name} must have shape (4, 4), not {T.shape}.")
    require_finite(name, T)
    R = T[:3, :3]
    if (
        not np.allclose(R @ R.T, np.eye(3), atol=1e-3)
        or np.linalg.det(R) < 0
        or not np.allclose(T[3], (0, 0, 0, 1))
    ):
        raise InputError(f"{name} is no rigid transform: its last row must be 0 0 0 1, its 3 x 3 part a rotation.")
    return T


def as_array(name: str, a: ArrayLike, dtype: type[np.generic]) -> NDArray[Any]:
    """Return an array of numbers, rows one after the other in memory.

    Raises
    ------
    InputError
        What is no array of numbers.
    """
    try:
        return np.ascontiguousarray(a, dtype=dtype)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers: {error}.") from error


def as_rows(name: str, a: ArrayLike, n: int, width: int | None, dtype: type[np.generic]) -> NDArray[Any]:
    """Return an array (n, width), of any width if None.

    Raises
    ------
    InputError
        Another shape.
    """
    a = as_array(name, a, dtype)
    if a.ndim != 2 or len(a) != n or (width is not None and a.shape[1] != width):
        raise InputError(f"{name} must have shape ({n}, {width or 'F'}) to go with {n} points, not {a.shape}.")
    return a


def require_finite(name: str, a: NDArray[Any]) -> None:
    """Check that no row has a number that is NaN or infinite.

    Raises
    ------
    InputError
        The rows that have, and how to drop them.
    """
    finite = np.isfinite(a).all(axis=tuple(range(1, a.ndim)))
    if not finite.all():
        raise InputError(
            f"{name} has NaN or infinite values in {np.count_nonzero(~finite)} of {len(a)} rows, "
            f"first in row {np.argmin(finite)}: drop them, for example with np.isfinite({name}).all(axis=1)."
        )


def checked_labels(labels: ArrayLike, n: int, n_classes: int) -> NDArray[np.int32]:
    """Return hard labels (n,), 0 to n_classes - 1 or `MISSING`.

    Raises
    ------
    InputError
        Another shape, fractions, or labels out of range.
    """
    raw = np.asarray(labels)
    if raw.ndim != 1 or len(raw) != n:
        raise InputError(f"labels must have shape ({n},) to go with {n} points, not {raw.shape}.")
    if raw.dtype.kind not in "iub" and n:
        raise InputError(f"labels must be whole numbers, not {raw.dtype}; a missing label is {MISSING}.")
    if n and (raw.min() < MISSING or raw.max() >= n_classes):
        raise InputError(
            f"labels go from {raw.min()} to {raw.max()}, but with {n_classes} classes they must lie "
            f"between 0 and {n_classes - 1}, or be {MISSING} where missing."
        )
    return np.ascontiguousarray(raw, dtype=np.int32)


def checked_weights(weights: ArrayLike, n: int, n_classes: int) -> NDArray[np.float32]:
    """Return soft labels (n, n_classes).

    Raises
    ------
    InputError
        Another shape, or weights that are negative or not finite.
    """
    w = as_rows("weights", weights, n, n_classes, np.float32)
    require_finite("weights", w)
    if (w < 0).any():
        raise InputError("weights (soft labels) must not be negative.")
    return w


def checked_covariances(name: str, a: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return covariance matrices of a shape (..., d, d), symmetric and positive semi-definite.

    Raises
    ------
    InputError
        Another shape, entries that are not finite, or matrices that are no covariances.
    """
    S = as_array(name, a, np.float64)
    if S.shape != shape:
        raise InputError(f"{name} must have shape {shape}, not {S.shape}.")
    require_finite(name, S)
    largest = np.abs(S).max(initial=0.0, axis=(-2, -1))
    rounding = 1e-6 * largest
    lopsided = np.abs(S - np.swapaxes(S, -2, -1)).max(initial=0.0, axis=(-2, -1)) > rounding
    bad = lopsided | (np.linalg.eigvalsh(S)[..., 0] < -rounding)
    if np.any(bad):
        where = "" if bad.ndim == 0 else f" in {np.count_nonzero(bad)} of {len(S)} rows, first in {np.argmax(bad)}"
        raise InputError(f"{name} must be symmetric without negative eigenvalues, which fails{where}.")
    return np.asarray((S + np.swapaxes(S, -2, -1)) / 2)


def checked_confidence(confidence: ArrayLike, n: int) -> NDArray[np.float32]:
    """Return confidences (n,), from 0 to 1.

    Raises
    ------
    InputError
        Another shape, or numbers out of range.
    """
    w = as_array("confidence", confidence, np.float32)
    if w.shape != (n,):
        raise InputError(f"confidence must have shape ({n},) to go with {n} points, not {w.shape}.")
    if not ((w >= 0) & (w <= 1)).all():
        raise InputError("confidence must lie between 0 (ignore the label) and 1 (a label like any other).")
    return w


def require_seed(seed: object) -> None:
    """Raise InputError for what is no whole number, or is negative."""
    if not isinstance(seed, Integral) or seed < 0:
        raise InputError(f"seed must be a whole number that is not negative, not {seed!r}.")
