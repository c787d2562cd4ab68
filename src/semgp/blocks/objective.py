"""What learning minimises: held-out log-loss plus a prior, as a function of free logarithms.

All parameters of a model, as logarithms in this order, are the kernel's theta, s_n, nugget, a, delta, v_0, the
three powers of the pool and the error rate. A matrix (parameters, free) says how they follow the free ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from semgp.blocks.arrays import F64
from semgp.blocks.covariance import mixture
from semgp.blocks.gradients import Gradient, add_gradient
from semgp.blocks.model import CLOSED, BlockModel
from semgp.blocks.patches import Packed, Patch, packed
from semgp.errors import InputError
from semgp.parallel import n_workers, parallel_map

Progress = Callable[[int, float], None]

_SCALARS = ("s_n", "nugget", "a", "delta", "v_0")
_POWERS = 3
_LINK = len(_SCALARS) + _POWERS + 1


class Objective:
    """Mean log-loss of the patches' held-out labels plus the prior's penalty, and its gradient.

    Parameters
    ----------
    start : BlockModel
        With a class prior.
    patches : sequence of Patch
        See `semgp.blocks.draw`.
    free : (P, n) array
        How the parameters move with the free ones, see `all_free`.
    spread : float
        Standard deviation of the prior of each free one, round 0.
    progress : callable, optional
        Called with the number of evaluations and the value.
    """

    def __init__(
        self, start: BlockModel, patches: Sequence[Patch], free: F64, spread: float, progress: Progress | None
    ) -> None:
        threads = min(n_workers(), len(patches))
        self._packs = [packed(patches[i::threads]) for i in range(threads)]
        self._start, self._free, self._n = start, free, len(patches)
        self._scale, self._progress = spread**2 * len(patches), progress
        self._n_classes = len(start.prior or ())
        self.evaluations = 0

    def model(self, x: F64) -> BlockModel:
        """Return the model of free parameters x (n,)."""
        start, step = self._start, self._free @ x
        theta, factor = step[:-_LINK], np.exp(step[-_LINK:])
        scalars = {name: getattr(start, name) * float(f) for name, f in zip(_SCALARS, factor)}
        scalars["error_rate"] = start.error_rate * float(factor[-1])
        w = np.array(start.powers) * factor[len(_SCALARS) : -1]
        kernel = start.kernel.with_theta(start.kernel.theta + theta)
        return replace(start, kernel=kernel, weights=(float(w[0]), float(w[1]), float(w[2])), **scalars)

    def penalty(self, x: F64) -> float:
        """Return the prior's share of the value."""
        return 0.5 * float(x @ x) / self._scale

    def __call__(self, x: F64) -> tuple[float, F64]:
        """Return value and gradient (n,) at x (n,)."""
        model = self.model(x)
        D, C = model.n_dims, self._n_classes
        kernel, noise, link = mixture(model.kernel, D), model.noise(C), model.link(C)

        def run(pack: Packed) -> Gradient:
            g = Gradient(np.zeros(1), np.zeros((len(kernel.kind), D + 1)), np.zeros(3), np.zeros(6))
            add_gradient(pack, D, kernel, noise, link, g)
            return g

        parts = parallel_map(run, self._packs)
        loss, d_kernel, d_noise, d_link = (sum(part[1:], part[0]) for part in zip(*parts, strict=True))
        values = np.array([*(getattr(model, name) for name in _SCALARS), *model.powers, model.error_rate])
        gradient = np.concatenate([_of_theta(model, d_kernel), np.concatenate([d_noise, d_link]) * values])
        value = float(loss[0]) / self._n + self.penalty(x)
        self.evaluations += 1
        if self._progress:
            self._progress(self.evaluations, value)
        return value, self._free.T @ gradient / self._n + x / self._scale


def all_free(model: BlockModel, vertical: int | None) -> F64:
    """Return the matrix that frees all parameters in use; length scales across a `vertical` axis are equal.

    Raises
    ------
    InputError
        A posterior that is not in closed form, or an axis that is none.
    """
    if model.posterior not in CLOSED:
        raise InputError(f"a {model.posterior} model is not learned by trials: learn one of {', '.join(CLOSED)}.")
    if vertical not in (None, 0, 1, 2):
        raise InputError(f"the vertical is axis 0, 1 or 2, or None, not {vertical}.")
    n_theta = len(model.kernel.theta)
    groups = _tied(model, vertical)
    w_i, w_l, w_v = model.powers
    used = (model.solves, model.solves, w_l > 0, w_i > 0, w_v > 0)
    groups += [[n_theta + i] for i, matters in enumerate(used) if matters]
    groups += [[n_theta + len(_SCALARS) + i] for i, w in enumerate((*model.powers, model.error_rate)) if w > 0]
    return _columns(n_theta, groups)


def temperature_free(model: BlockModel) -> F64:
    """Return the matrix that frees one common factor of the pool's powers."""
    n_theta = len(model.kernel.theta)
    return _columns(n_theta, [[n_theta + len(_SCALARS) + i for i in range(_POWERS)]])


def _columns(n_theta: int, groups: list[list[int]]) -> F64:
    """One column for each group of parameters that move together."""
    free = np.zeros((n_theta + _LINK, len(groups)))
    for column, group in enumerate(groups):
        free[group, column] = 1
    return free


def _tied(model: BlockModel, vertical: int | None) -> list[list[int]]:
    """Groups of the kernel's parameters: each by itself, but for the horizontal length scales of a term."""
    groups: list[list[int]] = []
    at = 0
    for term in model.terms:
        spatial = vertical is not None and len(term.ell) >= 3 and term.dims is None
        level = [at + d for d in range(3) if spatial and d != vertical]
        groups += [level] if level else []
        groups += [[at + d] for d in range(len(term.ell) + 1) if at + d not in level]
        at += len(term.ell) + 1
    return groups


def _of_theta(model: BlockModel, d_kernel: F64) -> F64:
    """Derivatives (Q, D + 1) by term and dimension, as those of the kernel's parameters."""
    parts = []
    for term, row in zip(model.terms, d_kernel, strict=True):
        d_ell = row[:-1] if term.dims is None else row[list(term.dims)]
        parts += [d_ell.sum(keepdims=True) if len(term.ell) == 1 else d_ell, row[-1:]]
    return np.concatenate(parts)
