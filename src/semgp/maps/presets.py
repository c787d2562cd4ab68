"""Models to begin with, for the sensors that most maps are made from.

Each is where learning starts when nothing else is known; `semgp learn` makes better ones from your own scans.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from semgp.blocks.model import BlockModel
from semgp.gp.stationary import Matern52

OUTDOOR_LIDAR = BlockModel(
    kernel=Matern52(ell=(0.6, 0.6, 0.15), sf=0.25) + Matern52(ell=(4.5, 4.5, 1.5), sf=0.35),
    resolution=0.2,
    s_n=0.25,
    nugget=0.12,
    a=0.3,
    delta=0.008,
    v_0=0.05,
    weights=(0.45, 0.4, 0.15),
)
"""Spinning lidar outdoors, z up, labels of a network: short and long length scales, shorter along the vertical."""

INDOOR_RGBD = BlockModel()
"""A depth camera indoors."""

PRESETS: Mapping[str, BlockModel] = {"indoor-rgbd": INDOOR_RGBD, "outdoor-lidar": OUTDOOR_LIDAR}
"""The models by name."""


def with_vertical(model: BlockModel, axis: int) -> BlockModel:
    """Return a model for a world whose vertical is `axis` instead of z (2)."""
    theta, at = np.array(model.kernel.theta), 0
    for term in model.terms:
        if len(term.ell) >= 3:
            theta[[at + axis, at + 2]] = theta[[at + 2, at + axis]]
        at += len(term.ell) + 1
    return replace(model, kernel=model.kernel.with_theta(theta))
