"""Prediction of many FITC posteriors at many points, in blocks and on all cores."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.gp.kernels import Array, Kernel
from semgp.parallel import parallel_map, slices

BLOCK = 512
"""Query points a block: their covariances with a few hundred inducing points stay in the processor's cache."""
PANELS = 8
"""A product with a triangular matrix is taken in so many column panels, each without its rows of zeros."""


@dataclass(frozen=True, eq=False)
class FITCPredictor:
    """Latent mean and variance of C posteriors that share kernel and inducing points.

    With v = L^-1 k_u(x), L L' = K_uu, the mean is k_u(x)' beta and the variance k(x, x) - |v|^2 + v' S^-1 v.
    The first difference is the same for all classes and the only one of large numbers: it is taken in float64.
    The rest is a sum of squares, |L_S^-1 v|^2, safe in float32 at any signal deviation.

    Parameters
    ----------
    kernel : Kernel
        Covariance function.
    U : (m, D) array
        Inducing inputs.
    whiten : (m, m) array
        Transposed inverse of the Cholesky factor of K_uu, upper triangular: v' = k_u' whiten.
    beta : (m, C) array
        Weights of the mean.
    roots : (m, C, m) float32 array
        Transposed inverses of the Cholesky factors of S, upper triangular for each class.
    """

    kernel: Kernel
    U: Array
    whiten: Array
    beta: Array
    roots: NDArray[np.float32]

    def __call__(self, X: Array) -> tuple[Array, Array]:
        """Return mean, prior mean excluded, and variance, both (M, C), at inputs X (M, D)."""
        m, C = self.beta.shape
        mean = np.empty((len(X), C))
        variance = np.empty_like(mean)
        edges = np.linspace(0, m, PANELS + 1).astype(int)
        columns = [slice(start, stop) for start, stop in pairwise(edges)]
        whiten = [np.ascontiguousarray(self.whiten[: c.stop, c]) for c in columns]
        roots = [np.ascontiguousarray(self.roots[: c.stop, :, c]).reshape(c.stop, -1) for c in columns]

        def predict(block: slice) -> None:
            K = self.kernel(X[block], self.U)
            mean[block] = K @ self.beta
            V = np.hstack([K[:, : c.stop] @ W for c, W in zip(columns, whiten, strict=True)])
            V32 = V.astype(np.float32)
            unexplained = self.kernel.diag(X[block]) - np.einsum("im,im->i", V, V)
            variance[block] = unexplained[:, None]
            for c, R in zip(columns, roots, strict=True):
                _add_squares(V32[:, : c.stop] @ R, variance[block])

        parallel_map(predict, slices(len(X), BLOCK))
        return mean, variance


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _add_squares(A: NDArray[np.float32], out: Array) -> Any:
    """Add to out (n, C) the squares of A (n, C * width), summed over each class's width."""
    n, C = out.shape
    width = A.shape[1] // C
    for i in range(n):
        for c in range(C):
            total = np.float32(0)
            for j in range(c * width, (c + 1) * width):
                total += A[i, j] * A[i, j]
            out[i, c] += total
