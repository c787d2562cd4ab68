"""Checks of a map's settings and stored arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError


def require_positive(name: str, value: float) -> float:
    """Return a setting as a float.

    Raises
    ------
    InputError
        A setting that is not positive and finite.
    """
    if not (isinstance(value, (int, float, np.number)) and math.isfinite(value) and value > 0):
        raise InputError(f"{name} must be a number, positive and finite, not {value!r}.")
    return float(value)


def require_prior(alpha0: float) -> float:
    """Return a prior class mass as a float.

    Raises
    ------
    InputError
        A mass that is negative or not finite.
    """
    return 0.0 if alpha0 == 0 else require_positive("alpha0, if not 0,", alpha0)


def require_data(n_stored: int) -> None:
    """Check that a map has something to answer with.

    Raises
    ------
    InputError
        A map that has not met one labelled point.
    """
    if n_stored == 0:
        raise InputError("the map has no labelled points yet: update it with a labelled cloud first.")


def stored_setting(header: Mapping[str, Any], name: str) -> Any:
    """Return an entry of a stored map's header.

    Raises
    ------
    InputError
        The entry is missing.
    """
    if name not in header:
        raise InputError(f"the stored map's header has no {name!r}: it is damaged or of another kind.")
    return header[name]


def stored_array(
    arrays: Mapping[str, NDArray[Any]],
    name: str,
    dtype: type[np.generic],
    shape: tuple[int | None, ...],
) -> NDArray[Any]:
    """Return an array of a stored map; None in `shape` stands for any length.

    Raises
    ------
    InputError
        The array is missing or has another type or shape.
    """
    if name not in arrays:
        raise InputError(f"the stored map has no array {name!r}: it is damaged or of another kind.")
    a = arrays[name]
    fits = a.ndim == len(shape) and all(want is None or have == want for have, want in zip(a.shape, shape))
    if a.dtype != dtype or not fits:
        wanted = f"{np.dtype(dtype)} of shape {shape}".replace("None", "any")
        raise InputError(f"the stored array {name!r} is {a.dtype} of shape {a.shape}, not {wanted}.")
    return np.ascontiguousarray(a)
