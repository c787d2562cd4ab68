"""Lower-triangular systems by BLAS and LAPACK themselves.

`scipy.linalg.solve_triangular` copies a row-major factor on each call and keeps the interpreter lock: for one
right-hand side that takes twenty times as long as the substitution. The transpose of a row-major factor is a
column-major view, upper triangular.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import get_blas_funcs, get_lapack_funcs


def solve_lower(L: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Return L^-1 b for row-major L (m, m) and b (m,)."""
    (trsv,) = get_blas_funcs(("trsv",), (L,))
    return np.asarray(trsv(L.T, b, lower=0, trans=1))


def solve_lower_transposed(L: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Return L'^-1 b for row-major L (m, m) and b (m,)."""
    (trsv,) = get_blas_funcs(("trsv",), (L,))
    return np.asarray(trsv(L.T, b, lower=0, trans=0))


def inverse(L: NDArray[Any]) -> NDArray[Any]:
    """Return the inverse of row-major L (m, m), row-major, lower triangular.

    Raises
    ------
    numpy.linalg.LinAlgError
        A zero on the diagonal.
    """
    (trtri,) = get_lapack_funcs(("trtri",), (L,))
    transposed, info = trtri(L.T, lower=0)
    if info != 0:
        raise np.linalg.LinAlgError(f"the factor is singular: its diagonal is zero at {info - 1}.")
    return np.asarray(np.triu(transposed).T)
