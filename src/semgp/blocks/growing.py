"""Arrays that grow in compiled loops."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def longer(a: Any, n: int) -> Any:
    """Return the array with room for n numbers."""
    out = np.empty(n, a.dtype)
    for i in range(len(a)):
        out[i] = a[i]
    return out


@njit(cache=True, nogil=True)
def longer_rows(a: Any, n: int) -> Any:
    """Return the array with room for n rows."""
    out = np.empty((n, a.shape[1]), a.dtype)
    for i in range(len(a)):
        for d in range(a.shape[1]):
            out[i, d] = a[i, d]
    return out
