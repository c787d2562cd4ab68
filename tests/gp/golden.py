"""The golden values, as arrays."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.gp.stationary import Matern12, Matern32, Matern52, SquaredExponential, Stationary

_RAW = json.loads((Path(__file__).parents[1] / "reference" / "gpml.json").read_text())
X, U, Q = (np.array(_RAW["dataset"][name]) for name in ("x", "xu", "xq"))
LABELS = np.array(_RAW["dataset"]["label"])
HYPER: dict[str, dict[str, Any]] = _RAW["hyper"]
VALUES: dict[str, dict[str, Any]] = _RAW["values"]


def kernel(setting: str, kind: str = "") -> Stationary:
    """Return the kernel of a setting; `kind` is the suffix of the entry's name."""
    kinds: dict[str, Callable[..., Stationary]] = {
        "matern12": Matern12,
        "matern32": Matern32,
        "se": SquaredExponential,
    }
    h = HYPER[setting]
    make: Callable[..., Stationary] = kinds.get(kind, Matern52)
    return make(tuple(np.exp(h["log_ell"])), float(np.exp(h["log_sf"])))


def targets(c: int) -> NDArray[np.float64]:
    """Return +1 for class c and -1 for the rest."""
    return np.where(c == LABELS, 1.0, -1.0)


def relative_error(value: Any, reference: Any) -> float:
    """Return the largest error over the largest entry."""
    reference = np.asarray(reference)
    return float(np.abs(np.asarray(value) - reference).max() / np.abs(reference).max())
