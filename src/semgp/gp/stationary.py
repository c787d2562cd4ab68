"""Stationary kernels: functions of the scaled distance r, with one length scale a dimension (ARD).

r^2 = sum_d (x_d - z_d)^2 / ell_d^2 and k(x, z) = sf^2 g(r). With h(r) = -g'(r) / r the gradient is
dk / dlog ell_d = sf^2 h(r) (x_d - z_d)^2 / ell_d^2 and dk / dlog sf = 2 k (Rasmussen & Williams, 4.2 and 5.1).
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from semgp.errors import InputError
from semgp.gp.kernels import Array, Kernel


@dataclass(frozen=True)
class Stationary(Kernel):
    """A kernel sf^2 g(r) of the scaled distance r.

    Parameters
    ----------
    ell : tuple of float
        Length scales, one for each active dimension, or a single one for all of them.
    sf : float
        Signal deviation: the standard deviation of the latent function.
    dims : tuple of int, optional
        Active dimensions of the input. Left out, all of them.

    Raises
    ------
    InputError
        Parameters that are not positive and finite, or length scales that do not fit the dimensions.
    """

    ell: tuple[float, ...]
    sf: float = 1.0
    dims: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        ell = tuple(float(v) for v in np.atleast_1d(self.ell))
        object.__setattr__(self, "ell", ell)
        object.__setattr__(self, "sf", float(self.sf))
        if not all(np.isfinite(v) and v > 0 for v in (*ell, self.sf)):
            raise InputError(f"length scales and signal deviation must be positive, not {ell}, {self.sf}.")
        if self.dims is not None and len(ell) not in (1, len(self.dims)):
            raise InputError(f"{len(ell)} length scales do not fit {len(self.dims)} active dimensions.")

    @staticmethod
    @abstractmethod
    def g(r2: Array) -> Array:
        """Return g(r) for squared distances; may overwrite them."""

    @staticmethod
    @abstractmethod
    def h(r2: Array) -> Array:
        """Return h(r) = -g'(r) / r for squared distances; may overwrite them."""

    @property
    def theta(self) -> Array:
        return np.log([*self.ell, self.sf])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        dims = self.dims or range(len(self.ell))
        ells = ("log ell",) if len(self.ell) == 1 else tuple(f"log ell[{d}]" for d in dims)
        return (*ells, "log sf")

    def with_theta(self, theta: ArrayLike) -> Self:
        values = np.exp(np.asarray(theta, dtype=np.float64))
        return replace(self, ell=tuple(values[:-1].tolist()), sf=float(values[-1]))

    def __call__(self, X: Array, Z: Array) -> Array:
        K = self.g(_squared_distances(*self._scaled(X, Z)))
        K *= X.dtype.type(self.sf**2)
        return K

    def diag(self, X: Array) -> Array:
        return np.full(len(X), self.sf**2)

    def contract(self, X: Array, Z: Array, G: Array) -> Array:
        A, B = self._scaled(X, Z)
        r2 = _squared_distances(A, B)
        d_sf = 2 * np.vdot(self.g(r2.copy()), G)
        d_ell = _weighted_squares(A, B, self.h(r2), G)
        if len(self.ell) == 1:
            d_ell = d_ell.sum(keepdims=True)
        return self.sf**2 * np.append(d_ell, d_sf)

    def contract_diag(self, X: Array, g: Array) -> Array:
        return np.append(np.zeros(len(self.ell)), 2 * self.sf**2 * g.sum())

    def _scaled(self, X: Array, Z: Array) -> tuple[Array, Array]:
        """Return X (n, D) and the transpose of Z (D, m), active dimensions only, over the length scales."""
        if self.dims is not None:
            X, Z = X[:, list(self.dims)], Z[:, list(self.dims)]
        if len(self.ell) not in (1, X.shape[1]):
            raise InputError(f"{len(self.ell)} length scales do not fit inputs of {X.shape[1]} dimensions.")
        scale = np.asarray(self.ell, dtype=X.dtype)
        return np.ascontiguousarray(X / scale), np.ascontiguousarray((Z / scale).T)


class Matern12(Stationary):
    """Matern kernel of smoothness 1/2, the exponential kernel: g = exp(-r)."""

    @staticmethod
    def g(r2: Array) -> Array:
        r = np.sqrt(r2, out=r2)
        return np.exp(np.negative(r, out=r), out=r)

    @staticmethod
    def h(r2: Array) -> Array:
        # h grows without bound towards r = 0, but dk / dlog ell, which multiplies it by r^2, vanishes there.
        r = np.sqrt(r2, out=r2)
        return np.divide(np.exp(-r), r, out=np.zeros_like(r), where=r > 0)


class Matern32(Stationary):
    """Matern kernel of smoothness 3/2: g = (1 + t) exp(-t), t = sqrt(3) r."""

    @staticmethod
    def g(r2: Array) -> Array:
        t = np.sqrt(np.multiply(r2, 3, out=r2), out=r2)
        e = np.exp(-t)
        t += 1
        t *= e
        return t

    @staticmethod
    def h(r2: Array) -> Array:
        return 3 * np.exp(-np.sqrt(3 * r2))


class Matern52(Stationary):
    """Matern kernel of smoothness 5/2, the paper's: g = (1 + t + t^2 / 3) exp(-t), t = sqrt(5) r."""

    @staticmethod
    def g(r2: Array) -> Array:
        t = np.sqrt(np.multiply(r2, 5, out=r2), out=r2)
        e = np.exp(-t)
        _times_one_t_t2_third(e, t)
        return e

    @staticmethod
    def h(r2: Array) -> Array:
        t = np.sqrt(5 * r2)
        return 5 / 3 * (1 + t) * np.exp(-t)


class SquaredExponential(Stationary):
    """Squared exponential kernel: g = exp(-r^2 / 2)."""

    @staticmethod
    def g(r2: Array) -> Array:
        return np.exp(np.multiply(r2, -0.5, out=r2), out=r2)

    @staticmethod
    def h(r2: Array) -> Array:
        return SquaredExponential.g(r2)


@njit(cache=True, nogil=True)
def _times_one_t_t2_third(e: Array, t: Array) -> None:
    """Multiply e by 1 + t + t^2 / 3, in place."""
    third = t.dtype.type(1 / 3)
    for i in range(t.shape[0]):
        for j in range(t.shape[1]):
            e[i, j] *= 1 + t[i, j] * (1 + t[i, j] * third)


@njit(cache=True, nogil=True)
def _squared_distances(A: Array, B: Array) -> Array:
    """Return the squared distances (n, m) between the rows of A (n, D) and the columns of B (D, m)."""
    n, m = A.shape[0], B.shape[1]
    r2 = np.empty((n, m), dtype=A.dtype)
    for i in range(n):
        row = r2[i]
        row[:] = 0
        for d in range(A.shape[1]):
            a = A[i, d]
            for j in range(m):
                difference = a - B[d, j]
                row[j] += difference * difference
    return r2


@njit(cache=True, nogil=True)
def _weighted_squares(A: Array, B: Array, h: Array, G: Array) -> Array:
    """Return sum_ij G_ij h_ij (A_id - B_dj)^2 for each dimension d."""
    total = np.zeros(A.shape[1])
    for i in range(A.shape[0]):
        for d in range(A.shape[1]):
            a = A[i, d]
            s = 0.0
            for j in range(B.shape[1]):
                difference = a - B[d, j]
                s += G[i, j] * h[i, j] * difference * difference
            total[d] += s
    return total
