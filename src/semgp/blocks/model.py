"""The block map's model: everything that learning sets and that updates never change."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semgp.blocks.covariance import stationary_terms
from semgp.blocks.link import Link
from semgp.blocks.members import Sizes
from semgp.blocks.solve import Noise
from semgp.gp.kernels import Kernel
from semgp.gp.stationary import Matern52, Stationary

@dataclass(frozen=True)
class BlockModel:
    kernel: Kernel = field(default_factory=lambda: Matern52(ell=(.52,.08,.52),sf=.047**.5)+Matern52(ell=(4.5,1.64,4.5),sf=.085**.5))
    resolution: float = 0.2
    s_n: float = 1.3
    nugget: float = 0.054
    a: float = 0.5
    delta: float = 0.008
    v_0: float = 0.05
    weights: tuple[float, float, float] = (0.5, 0.5, 0.0)
    prior: tuple[float, ...] | None = None
    n_features: int = 0
    leaf: int = 48
    near: int = 16
    far: int = 32
    blend: float = 1.0

    @property
    def sizes(self) -> Sizes:
        return Sizes(self.leaf, self.far, self.leaf + self.near + self.far)

    @property
    def solves(self) -> bool:
        return self.weights[0] > 0 or self.weights[1] > 0

    def noise(self) -> Noise:
        return Noise(float(self.s_n), float(self.nugget), float(self.a), self.class_prior(len(self.prior or ())), self.solves)

    def link(self) -> Link:
        prior = self.class_prior(len(self.prior or ()))
        w_i, w_l, w_v = (np.float32(w) for w in self.weights)
        return Link(prior, prior ** (w_i + w_l + w_v), np.float32(self.delta), np.float32(self.v_0), w_i, w_l, w_v)

    def class_prior(self, n_classes: int) -> NDArray[np.float32]:
        if self.prior is None:
            return np.full(n_classes, 1 / n_classes, np.float32)
        p = np.asarray(self.prior)
        return (p / p.sum()).astype(np.float32)

    @property
    def terms(self) -> list[Stationary]:
        return stationary_terms(self.kernel)
