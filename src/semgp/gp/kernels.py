"""Covariance functions as small immutable values with an algebra: `k1 + k2`, `k1 * k2`.

A kernel is a function of two sets of inputs and of its parameters theta, the logarithms of its length scales
and signal deviations. Gradients are never formed as matrices: `contract` returns sum_ij G_ij dK_ij / dtheta.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.errors import InputError

Array = NDArray[np.float64]


class Kernel(ABC):
    """A positive-definite function k(x, z) of inputs with any number of dimensions."""

    @property
    @abstractmethod
    def theta(self) -> Array:
        """Parameters (P,): logarithms of the length scales and signal deviations."""

    @property
    @abstractmethod
    def parameter_names(self) -> tuple[str, ...]:
        """One name a parameter, in the order of `theta`."""

    @abstractmethod
    def with_theta(self, theta: ArrayLike) -> Kernel:
        """Return the same kernel with other parameters."""

    @abstractmethod
    def __call__(self, X: Array, Z: Array) -> Array:
        """Return the covariances (n, m) between inputs X (n, D) and Z (m, D), in the precision of X."""

    @abstractmethod
    def diag(self, X: Array) -> Array:
        """Return k(x, x), shape (n,), for inputs X (n, D)."""

    @abstractmethod
    def contract(self, X: Array, Z: Array, G: Array) -> Array:
        """Return sum_ij G_ij dk(x_i, z_j) / dtheta, shape (P,), for weights G (n, m)."""

    @abstractmethod
    def contract_diag(self, X: Array, g: Array) -> Array:
        """Return sum_i g_i dk(x_i, x_i) / dtheta, shape (P,), for weights g (n,)."""

    def __add__(self, other: Kernel) -> Kernel:
        return Sum(self, other)

    def __mul__(self, other: Kernel) -> Kernel:
        return Product(self, other)


@dataclass(frozen=True)
class _Pair(Kernel):
    """Two kernels whose parameters stand one after the other."""

    left: Kernel
    right: Kernel

    @property
    def theta(self) -> Array:
        return np.concatenate([self.left.theta, self.right.theta])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        left = tuple(f"left.{name}" for name in self.left.parameter_names)
        return left + tuple(f"right.{name}" for name in self.right.parameter_names)

    def with_theta(self, theta: ArrayLike) -> Kernel:
        theta = np.asarray(theta, dtype=np.float64)
        n = len(self.left.theta)
        return type(self)(self.left.with_theta(theta[:n]), self.right.with_theta(theta[n:]))


class Sum(_Pair):
    """The sum of two kernels: independent functions that add up."""

    def __call__(self, X: Array, Z: Array) -> Array:
        return self.left(X, Z) + self.right(X, Z)

    def diag(self, X: Array) -> Array:
        return self.left.diag(X) + self.right.diag(X)

    def contract(self, X: Array, Z: Array, G: Array) -> Array:
        return np.concatenate([self.left.contract(X, Z, G), self.right.contract(X, Z, G)])

    def contract_diag(self, X: Array, g: Array) -> Array:
        return np.concatenate([self.left.contract_diag(X, g), self.right.contract_diag(X, g)])


class Product(_Pair):
    """The product of two kernels: alike only where both say so."""

    def __call__(self, X: Array, Z: Array) -> Array:
        return self.left(X, Z) * self.right(X, Z)

    def diag(self, X: Array) -> Array:
        return self.left.diag(X) * self.right.diag(X)

    def contract(self, X: Array, Z: Array, G: Array) -> Array:
        left = self.left.contract(X, Z, G * self.right(X, Z))
        return np.concatenate([left, self.right.contract(X, Z, G * self.left(X, Z))])

    def contract_diag(self, X: Array, g: Array) -> Array:
        left = self.left.contract_diag(X, g * self.right.diag(X))
        return np.concatenate([left, self.right.contract_diag(X, g * self.left.diag(X))])


def checked_inputs(X: ArrayLike) -> Array:
    """Check inputs of a kernel, shape (n, D), and return them as float64.

    Raises
    ------
    InputError
        Wrong shape, no rows, or NaN or infinite values.
    """
    X = np.ascontiguousarray(X, dtype=np.float64)
    if X.ndim != 2 or not len(X):
        raise InputError(f"inputs must have shape (n, D) with n > 0, not {X.shape}.")
    if not np.isfinite(X).all():
        raise InputError("inputs have NaN or infinite values: drop those rows.")
    return X
