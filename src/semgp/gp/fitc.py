"""FITC: the covariance of n points through m inducing points, K ~ Q + diag(K - Q), Q = K_fu K_uu^-1 K_uf.

Snelson & Ghahramani 2006; Naish-Guzman & Holden 2007 for classification. With K_uu = L L' and V = L^-1 K_uf
the covariance is V'V + D, D = diag(K - V'V), and every n x n matrix reduces to S = I + V T V' (m x m) with
T = diag(W / (1 + D W)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from semgp.errors import InputError
from semgp.gp.covariance import Term
from semgp.gp.fitc_predictor import FITCPredictor
from semgp.gp.kernels import Array, Kernel, checked_inputs
from semgp.gp.triangular import inverse, solve_lower, solve_lower_transposed
from semgp.parallel import parallel_map, slices

ROUNDING = 1e-17
"""A column of V whose share in S is below this beside the identity cannot change S in double precision."""
COLUMNS = 500
"""Training points a block: what is computed of them stays in the processor's cache, and no array but V is large.

Fresh memory is dear: touching 12 MB for the first time can take longer than the product that fills it.
"""


class FITCCovariance:
    """The FITC approximation of the covariance matrix.

    Parameters
    ----------
    kernel : Kernel
        Covariance function.
    X : (n, D) array
        Training inputs.
    U : (m, D) array
        Inducing inputs.
    jitter : float, optional
        Added to the diagonal of K_uu, relative to its mean.
    absolute_jitter : bool, optional
        Take the jitter as it is, not relative to the diagonal.

    Raises
    ------
    InputError
        Inputs that are not finite or do not agree, or a K_uu that is not positive definite.
    """

    def __init__(
        self, kernel: Kernel, X: Array, U: Array, jitter: float = 1e-6, absolute_jitter: bool = False
    ) -> None:
        self.kernel = kernel
        self.X, self.U = checked_inputs(X), checked_inputs(U)
        if self.X.shape[1] != self.U.shape[1]:
            raise InputError(f"inputs have {self.X.shape[1]} dimensions, inducing inputs {self.U.shape[1]}.")
        self.n = len(self.X)
        self.jitter, self.absolute_jitter = jitter, absolute_jitter
        K_uu = kernel(self.U, self.U)
        K_uu[np.diag_indices(len(self.U))] += jitter * (1 if absolute_jitter else kernel.diag(self.U).mean())
        try:
            self.L = cholesky(K_uu, lower=True, check_finite=False)
        except np.linalg.LinAlgError as error:
            raise InputError(
                "the covariance of the inducing points is not positive definite: raise the jitter, or remove "
                "inducing points that lie on top of each other."
            ) from error
        self.V = np.empty((len(self.U), self.n))
        parallel_map(self._whiten, slices(self.n, COLUMNS))
        self.D = kernel.diag(self.X) - np.einsum("mn,mn->n", self.V, self.V)

    def _whiten(self, block: slice) -> None:
        K_uf = self.kernel(self.U, self.X[block])
        self.V[:, block] = solve_triangular(self.L, K_uf, lower=True, check_finite=False, overwrite_b=True)

    def matvec(self, v: Array) -> Array:
        """Return K v for v (n,)."""
        return np.asarray((self.V @ v) @ self.V + self.D * v)

    @cached_property
    def _V_single(self) -> NDArray[np.float32]:
        return self.V.astype(np.float32)

    def factorise(self, W: Array, rough: bool = False) -> FITCFactor:
        """Factorise K together with curvatures W (n,), in single precision where `rough` and possible."""
        T = W / (1 + self.D * W)
        V = self._V_single if rough else self.V
        root_T = np.sqrt(T).astype(V.dtype)
        # Saturated points (W ~ 0) are most of a class; leaving them out changes nothing and saves the time.
        matter = np.flatnonzero(T * (self.kernel.diag(self.X) - self.D) > ROUNDING)
        S = np.zeros((len(V), len(V)), dtype=V.dtype)
        scratch = np.empty((len(V), 2 * COLUMNS), dtype=V.dtype)
        for block in slices(len(matter), 2 * COLUMNS):
            columns = block if len(matter) == self.n else matter[block]
            VT = np.multiply(V[:, columns], root_T[columns], out=scratch[:, : block.stop - block.start])
            S += VT @ VT.T
        S[np.diag_indices(len(S))] += 1
        try:
            return FITCFactor(V, self.D, W, T, np.linalg.cholesky(S))
        except np.linalg.LinAlgError:
            if rough:  # too ill conditioned for single precision
                return self.factorise(W)
            raise

    def gradient(self, terms: Sequence[Term[FITCFactor]]) -> Array:
        """Return the sum over the terms of tr(G dK / dtheta), shape (P,).

        dK = dQ + diag(dK - dQ), so with G0 = G - diag(G) and P = K_uu^-1 K_uf the sum is
        2 tr(G0 P' dK_uf) - tr(P G0 P' dK_uu) + sum_i G_ii dk_ii. M collects L' P G0, which S keeps cheap:
        V R = S^-1 V T.
        """
        A = np.column_stack([term.a for term in terms])
        U = np.column_stack([term.u for term in terms])
        g = np.zeros(self.n)
        for term in terms:
            g += term.factor.R_diagonal() / 2 + term.a * (term.u - term.a / 2)
        VA, VU = self.V @ A, self.V @ U

        def share(block: slice) -> tuple[Array, Array]:
            """Return tr(G0 P' dK_uf) and P G0 V' of some columns: M never exists as a whole."""
            V = self.V[:, block]
            M = (VU - VA) @ A[block].T / 2 + VA @ U[block].T / 2 - V * g[block]
            scratch = np.empty_like(M)
            for term in terms:
                M += np.multiply(
                    np.matmul(term.factor.S_inverse, V, out=scratch), term.factor.T[block] / 2, out=scratch
                )
            H = solve_triangular(self.L, M, lower=True, trans=1, check_finite=False, overwrite_b=True)
            return self.kernel.contract(self.U, self.X[block], H), H @ V.T

        d_uf, HV = (sum(parts) for parts in zip(*parallel_map(share, slices(self.n, COLUMNS)), strict=True))
        HP = solve_triangular(self.L, HV.T, lower=True, trans=1, check_finite=False)
        gradient = 2 * d_uf - self.kernel.contract(self.U, self.U, HP)
        if not self.absolute_jitter:
            mean_weight = np.full(len(self.U), self.jitter * np.trace(HP) / len(self.U))
            gradient -= self.kernel.contract_diag(self.U, mean_weight)
        return np.asarray(gradient + self.kernel.contract_diag(self.X, g))

    def predictor(self, terms: Sequence[Term[FITCFactor]]) -> FITCPredictor:
        """Return what predicts for the posteriors of the terms."""
        A = np.column_stack([term.a for term in terms])
        beta = solve_triangular(self.L, self.V @ A, lower=True, trans=1)
        roots = np.stack([inverse(term.factor.L).T for term in terms], axis=1)
        return FITCPredictor(
            self.kernel, self.U, inverse(np.ascontiguousarray(self.L)).T, beta, roots.astype(np.float32)
        )


@dataclass(frozen=True, eq=False)
class FITCFactor:
    """L L' = S = I + V T V', T = W / (1 + D W)."""

    V: NDArray[Any]
    D: Array
    W: Array
    T: Array
    L: NDArray[Any]

    @property
    def log_det_B(self) -> float:
        """log |B| = log |S| + log |I + D W|."""
        return float(2 * np.log(np.diag(self.L)).sum() + np.log1p(self.D * self.W).sum())

    @cached_property
    def S_inverse(self) -> Array:
        """S^-1 (m, m)."""
        L_inverse = inverse(self.L)
        return np.asarray(L_inverse.T @ L_inverse)

    @cached_property
    def _v_S_inverse_v(self) -> Array:
        """v' S^-1 v for each column v of V, shape (n,), block by block: S^-1 V is as large as V."""
        squares = np.empty(self.V.shape[1])
        scratch = np.empty((len(self.V), COLUMNS))
        for block in slices(self.V.shape[1], COLUMNS):
            V = self.V[:, block]
            np.einsum(
                "mn,mn->n", V, np.matmul(self.S_inverse, V, out=scratch[:, : V.shape[1]]), out=squares[block]
            )
        return squares

    def solve(self, v: Array) -> Array:
        """Return R v = T v - T V' S^-1 V T v for v (n,)."""
        Tv = self.T * v
        half = solve_lower(self.L, self.V @ Tv.astype(self.V.dtype))
        return np.asarray(Tv - self.T * (solve_lower_transposed(self.L, half) @ self.V))

    def R_diagonal(self) -> Array:
        """Return the diagonal (n,) of R."""
        return self.T - self.T**2 * self._v_S_inverse_v

    def marginal_variance(self) -> Array:
        """Return the diagonal (n,) of (K^-1 + W)^-1.

        Given the inducing values, f_i has variance D / (1 + D W); their posterior adds the rest.
        """
        shrink = 1 / (1 + self.D * self.W)
        return shrink * self.D + shrink**2 * self._v_S_inverse_v
