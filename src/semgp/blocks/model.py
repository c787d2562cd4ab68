"""The block map's model: everything that learning sets and that updates never change."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from semgp.blocks.arrays import F32
from semgp.blocks.covariance import stationary_terms
from semgp.blocks.link import Link
from semgp.blocks.members import Sizes
from semgp.blocks.solve import Noise
from semgp.errors import InputError
from semgp.gp.kernels import Kernel
from semgp.gp.model import kernel_from_json, kernel_to_json
from semgp.gp.stationary import Matern52, Stationary

CLOSED: Mapping[str, tuple[float, float, float]] = {
    "pool": (0.5, 0.35, 0.1),
    "indicator": (1.0, 0.0, 0.0),
    "log-ratio": (0.0, 1.0, 0.0),
    "vote": (0.0, 0.0, 1.0),
}
"""Posteriors in closed form, with the powers of the indicator, log-ratio and vote predictors in their pool."""

EXPERTS = ("dirichlet", "laplace", "ep", "softmax")
"""Posteriors that each block solves by itself, class by class: slower, for comparison."""

_POSITIVE = ("resolution", "s_n", "nugget", "a", "delta", "v_0")
_FINEST, _COARSEST = 1e-6, 1e6  # metres
_MOST_MEMBERS = 1024  # a block's covariance is a dense matrix


@dataclass(frozen=True)
class BlockModel:
    """Kernel, noise, link and block sizes of a map of many blocks.

    Parameters
    ----------
    kernel : Kernel, optional
        A sum of stationary kernels over position, in metres, and features.
    resolution : float, optional
        Edge of a voxel in metres: labels in one voxel are one site.
    posterior : str, optional
        "pool", "indicator", "log-ratio" or "vote", see `semgp.blocks.link`; or "dirichlet", "laplace", "ep",
        "softmax", see `semgp.blocks.experts`.
    weights : (float, float, float), optional
        Powers of the indicator, log-ratio and vote predictors; left out, those that `posterior` names.
    s_n : float, optional
        Noise variance of one label.
    nugget : float, optional
        Noise variance of a site that more labels do not take away: errors that its labels share.
    a : float, optional
        Prior mass, in labels, of log-ratio targets; prior mass of a class for Dirichlet targets.
    delta : float, optional
        Floor of the indicator predictor, times the prior.
    v_0 : float, optional
        Mass of the prior in the vote.
    prior : tuple of float, optional
        Class frequencies, one a class; left out, all alike. Part of the model, so that data in one place do not
        change the map in another.
    other : bool, optional
        For soft labels, class probabilities: what a row lacks to one is the mass of no class of the map, and kept.
    error_rate, error_power : float, optional
        b and k of the share of errors, see `semgp.blocks.link`; a rate of 0 for none.
    errors : tuple of float, optional
        How errors fall on the classes, r; left out, evenly.
    features : tuple of str, optional
        Inputs beyond position: names of a cloud's features, or "red", "green", "blue" (0 to 1).
    leaf, near, far : int, optional
        A block has at most `leaf` sites of its own, `near` single sites round them (more where it has fewer of its
        own), and `far` coarse voxels farther out.
    blend : float, optional
        Edge, in voxels, of the box over which neighbouring blocks blend.

    Raises
    ------
    InputError
        Numbers out of range, unknown names, a kernel that does not fit.
    """

    kernel: Kernel = Matern52(ell=(0.15,), sf=0.3) + Matern52(ell=(1.0,), sf=0.4)
    resolution: float = 0.05
    posterior: str = "pool"
    weights: tuple[float, float, float] | None = None
    s_n: float = 0.3
    nugget: float = 0.1
    a: float = 0.25
    delta: float = 0.005
    v_0: float = 0.05
    prior: tuple[float, ...] | None = None
    other: bool = False
    error_rate: float = 0.0
    error_power: float = 0.4
    errors: tuple[float, ...] | None = None
    features: tuple[str, ...] = ()
    leaf: int = 64
    near: int = 8
    far: int = 24
    blend: float = 1.5

    def __post_init__(self) -> None:
        if self.posterior not in (*CLOSED, *EXPERTS):
            raise InputError(f"posterior must be one of {', '.join((*CLOSED, *EXPERTS))}, not {self.posterior!r}.")
        for name in _POSITIVE:
            value = getattr(self, name)
            if not (isinstance(value, int | float | np.number) and math.isfinite(value) and value > 0):
                raise InputError(f"{name} must be a number, positive and finite, not {value!r}.")
            object.__setattr__(self, name, float(value))
        if not _FINEST <= self.resolution <= _COARSEST:
            raise InputError(f"resolution must lie from {_FINEST:g} to {_COARSEST:g} m, not {self.resolution}.")
        weights = CLOSED.get(self.posterior, (0.0, 0.0, 1.0)) if self.weights is None else self.weights
        powers = tuple(float(w) for w in weights)
        if len(powers) != 3 or not all(math.isfinite(w) and w >= 0 for w in powers) or sum(powers) <= 0:
            raise InputError(f"weights must be three numbers, none negative, not all zero, not {weights}.")
        object.__setattr__(self, "weights", powers)
        for name in ("prior", "errors"):
            given = getattr(self, name)
            if given is not None:
                frequencies = tuple(float(p) for p in given)
                if not frequencies or not all(math.isfinite(p) and p > 0 for p in frequencies):
                    raise InputError(f"{name} must have a positive frequency for each class.")
                object.__setattr__(self, name, frequencies)
        if not isinstance(self.other, bool):
            raise InputError(f"other is true or false, not {self.other!r}.")
        if not (0 <= self.error_rate < math.inf and 0 < self.error_power < math.inf):
            raise InputError("error_rate must be 0 or above, error_power above 0, both finite.")
        if self.posterior in EXPERTS and (self.other or self.error_rate > 0):
            raise InputError(f"a {self.posterior} model knows no other mass and no error rate.")
        if isinstance(self.features, str):
            raise InputError(f"features must be a tuple of names, such as ({self.features!r},).")
        object.__setattr__(self, "features", tuple(self.features))
        if not all(isinstance(v, int) for v in (self.leaf, self.near, self.far)):
            raise InputError("leaf, near and far are numbers of members: whole numbers.")
        if self.leaf < 2 or self.near < 0 or self.far < 0 or self.members > _MOST_MEMBERS:
            raise InputError(f"a block needs 2 own sites at least and {_MOST_MEMBERS} members at most.")
        if not 0 < self.blend <= 8:
            raise InputError(f"blend must be above 0 and at most 8 voxels, not {self.blend}.")
        for term in self.terms:
            dims = range(self.n_dims) if term.dims is None else term.dims
            if not dims or not all(0 <= d < self.n_dims for d in dims) or len(term.ell) not in (1, len(dims)):
                raise InputError(f"length scales {term.ell} of dimensions {dims} do not fit {self.n_dims} inputs.")

    @property
    def n_dims(self) -> int:
        """Number of inputs D: three coordinates and the features."""
        return 3 + len(self.features)

    @property
    def members(self) -> int:
        """Most members of a block."""
        return self.leaf + self.near + self.far

    @property
    def terms(self) -> list[Stationary]:
        """The terms of the kernel."""
        return stationary_terms(self.kernel)

    @property
    def powers(self) -> tuple[float, float, float]:
        """Powers of the three predictors in the pool."""
        assert self.weights is not None
        return self.weights

    @property
    def solves(self) -> bool:
        """Whether blocks solve the closed form: a vote alone does not, nor do experts."""
        return self.posterior in CLOSED and (self.powers[0] > 0 or self.powers[1] > 0)

    def fits(self, n_classes: int) -> None:
        """Raise InputError where prior or errors are for another number of classes."""
        for name in ("prior", "errors"):
            given = getattr(self, name)
            if given is not None and len(given) != n_classes:
                raise InputError(f"the model's {name} is for {len(given)} classes, the map has {n_classes}.")

    def class_prior(self, n_classes: int) -> F32:
        """Return the prior probabilities (C,), or (C + 1,) with that of the mass of no class, an even share."""
        prior = np.ones(n_classes) if self.prior is None else np.asarray(self.prior)
        prior = prior / prior.sum()
        if self.other:
            prior = np.append(prior * n_classes, 1.0) / (n_classes + 1)
        return np.asarray(prior, dtype=np.float32)

    def sizes(self) -> Sizes:
        """Return the block sizes for compiled code."""
        return Sizes(self.leaf, self.far, self.members)

    def noise(self, n_classes: int) -> Noise:
        """Return what targets and noise depend on, for compiled code."""
        return Noise(self.s_n, self.nugget, self.a, self.class_prior(n_classes), self.solves)

    def link(self, n_classes: int) -> Link:
        """Return the link for compiled code."""
        prior = self.class_prior(n_classes)
        w_i, w_l, w_v = (np.float32(w) for w in self.powers)
        errors = np.ones(n_classes) if self.errors is None else np.asarray(self.errors)
        power = (prior / prior.max()) ** (w_i + w_l + w_v)
        return Link(
            prior, power, np.float32(self.delta), np.float32(self.v_0), w_i, w_l, w_v,
            self.other, np.asarray(errors / errors.sum(), dtype=np.float32), self.error_rate, self.error_power,
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """Return the model as a dictionary ready for JSON."""
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__}
        lists = {name: list(plain[name]) for name in ("weights", "features")}
        maybe = {n: None if plain[n] is None else list(plain[n]) for n in ("prior", "errors")}
        return plain | lists | maybe | {"kernel": kernel_to_json(self.kernel)}

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> BlockModel:
        """Make the model again from what `to_json` gave.

        Raises
        ------
        InputError
            Fields that are missing, unknown or of the wrong kind.
        """
        if not isinstance(plain, Mapping):
            raise InputError("this is no block model: it is no set of named values.")
        listed = ("prior", "errors", "weights", "features")
        if any(not isinstance(plain.get(n, []), list | tuple | None) for n in listed):
            raise InputError(f"this is no block model: {', '.join(listed)} must be lists.")
        missing = cls.__dataclass_fields__.keys() - plain.keys()
        if missing:
            raise InputError(f"this is no block model: it lacks {', '.join(sorted(missing))}.")
        try:
            lists = {n: tuple(plain[n]) for n in ("weights", "features")}
            maybe = {n: None if plain[n] is None else tuple(plain[n]) for n in ("prior", "errors")}
            return cls(**{**plain, **lists, **maybe, "kernel": kernel_from_json(plain["kernel"])})
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"this is no block model: {error}") from error
