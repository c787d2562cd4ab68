"""A model: what a GP map assumes before it sees data. Immutable; learning makes a new one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from semgp.errors import InputError
from semgp.gp.inducing import INDUCING
from semgp.gp.kernels import Kernel, Product, Sum
from semgp.gp.likelihoods import LIKELIHOODS
from semgp.gp.probability import RULES
from semgp.gp.stationary import Matern12, Matern32, Matern52, SquaredExponential, Stationary

STATIONARY: dict[str, type[Stationary]] = {
    k.__name__: k for k in (Matern12, Matern32, Matern52, SquaredExponential)
}
"""The stationary kernels by name."""
INFERENCE = ("laplace", "ep", "softmax")
"""Laplace one-vs-rest (the paper's), expectation propagation one-vs-rest, multi-class softmax Laplace."""


@dataclass(frozen=True)
class GPModel:
    """Kernel, likelihood, inference and the sizes that bound the cost.

    Parameters
    ----------
    kernels : tuple of Kernel, optional
        One kernel shared by all classes, or one a class. Lengths in metres.
    m : tuple of float, optional
        Constant mean of the latent function: one for all classes, or one a class.
    likelihood : {"probit", "logistic"}, optional
        p(y | f) of one-vs-rest inference.
    inference : {"laplace", "ep", "softmax"}, optional
        Laplace one-vs-rest, the paper's; expectation propagation; or multi-class softmax with Laplace.
    n_inducing : int or None, optional
        Inducing points of FITC; None for the dense covariance, which "ep" and "softmax" need.
    inducing : {"k-means", "farthest", "random"}, optional
        How they are chosen.
    max_points : int, optional
        At most so many training points, drawn at random, enter the posterior.
    rule : {"softmax", "plug-in", "averaged"}, optional
        How latent functions become class probabilities; see `semgp.gp.probability`.
    seed : int, optional
        Seed of the draws above.

    Raises
    ------
    InputError
        Unknown names, numbers out of range, or a combination that does not exist.
    """

    kernels: tuple[Kernel, ...] = (Matern52(ell=(0.5, 0.5, 0.5), sf=5.0),)
    m: tuple[float, ...] = (-1.0,)
    likelihood: str = "probit"
    inference: str = "laplace"
    n_inducing: int | None = 300
    inducing: str = "k-means"
    max_points: int = 5000
    rule: str = "softmax"
    seed: int = 0

    def __post_init__(self) -> None:
        choices = {"likelihood": LIKELIHOODS, "inference": INFERENCE, "inducing": INDUCING, "rule": RULES}
        for field, known in choices.items():
            if getattr(self, field) not in known:
                raise InputError(f"{field} must be one of {', '.join(known)}, not {getattr(self, field)!r}.")
        if self.n_inducing is not None and self.inference != "laplace":
            raise InputError(f"inference {self.inference!r} needs the dense covariance: set n_inducing to None.")
        if self.max_points < 1 or (self.n_inducing is not None and self.n_inducing < 1):
            raise InputError("max_points and n_inducing must be at least one.")
        if not self.kernels or not self.m:
            raise InputError("a model needs at least one kernel and one mean.")

    def kernel(self, c: int) -> Kernel:
        """Return the kernel of class c."""
        return self.kernels[c if len(self.kernels) > 1 else 0]

    def mean(self, c: int) -> float:
        """Return the constant mean of class c."""
        return self.m[c if len(self.m) > 1 else 0]

    def fits(self, n_classes: int) -> None:
        """Raise InputError where kernels or means are for another number of classes."""
        for name, values in (("kernels", self.kernels), ("means", self.m)):
            if len(values) not in (1, n_classes):
                raise InputError(f"the model has {len(values)} {name}, which do not fit {n_classes} classes.")

    def to_json(self) -> dict[str, Any]:
        """Return the model as a dictionary ready for JSON."""
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return plain | {"kernels": [kernel_to_json(kernel) for kernel in self.kernels], "m": list(self.m)}

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> GPModel:
        """Make the model again from what `to_json` gave.

        Raises
        ------
        InputError
            Fields that are missing, unknown or of the wrong kind.
        """
        try:
            kernels = tuple(kernel_from_json(kernel) for kernel in plain["kernels"])
            rest = {name: value for name, value in plain.items() if name not in ("kernels", "m")}
            return cls(kernels=kernels, m=tuple(float(v) for v in plain["m"]), **rest)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"this is no GP model: {error}") from error


def kernel_to_json(kernel: Kernel) -> dict[str, Any]:
    """Return a kernel as a dictionary ready for JSON."""
    if isinstance(kernel, Sum | Product):
        parts = {"left": kernel_to_json(kernel.left), "right": kernel_to_json(kernel.right)}
        return {"name": type(kernel).__name__, **parts}
    if isinstance(kernel, Stationary):
        return {"name": type(kernel).__name__, **asdict(kernel)}
    raise InputError(f"{type(kernel).__name__} cannot be stored: add it to semgp.gp.model.")


def kernel_from_json(plain: Mapping[str, Any]) -> Kernel:
    """Make the kernel again from what `kernel_to_json` gave."""
    name = plain["name"]
    if name in ("Sum", "Product"):
        pair = Sum if name == "Sum" else Product
        return pair(kernel_from_json(plain["left"]), kernel_from_json(plain["right"]))
    if name not in STATIONARY:
        raise InputError(f"no kernel is called {name!r}.")
    dims = plain["dims"]
    return STATIONARY[name](tuple(plain["ell"]), plain["sf"], None if dims is None else tuple(dims))
