"""Models to begin with, for the sensors that most maps are made from.

`benchmarks/learn_presets.py` prints what the learned ones are rounded from. Each is also where learning can start:
`semgp learn` makes better ones from your own scans.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from semgp.blocks.model import BlockModel
from semgp.gp.stationary import Matern52

GENERAL = BlockModel(
    kernel=Matern52(ell=(0.0528,), sf=0.174) + Matern52(ell=(0.349,), sf=0.185),
    resolution=0.05, s_n=0.5, nugget=0.108, a=0.209, delta=0.00507, v_0=0.0537, weights=(1.48, 0.579, 0.079),
)  # fmt: skip
"""Indoor scans, some labels missing, some wrong, sites of five centimetres: learned from six synthetic rooms."""

OUTDOOR_LIDAR = BlockModel(
    kernel=Matern52(ell=(0.429, 0.429, 0.125), sf=0.19) + Matern52(ell=(5.31, 5.31, 1.27), sf=0.696),
    resolution=0.2, s_n=0.289, nugget=0.0955, a=0.237, delta=0.00643, v_0=0.0441, weights=(0.414, 0.365, 0.169),
)  # fmt: skip
"""A spinning lidar outdoors, z up, with the labels of a network: learned from ten SemanticKITTI scans."""

INDOOR_RGBD = BlockModel(
    kernel=Matern52(ell=(0.17,), sf=1.92),
    resolution=0.05, s_n=17.4, nugget=1.13, a=2.44, v_0=0.875, weights=(0.0, 0.315, 0.206),
)  # fmt: skip
"""A depth camera indoors, with a network's label at every pixel: learned from eight NYU Depth V2 frames."""

INDOOR_LABELS = BlockModel(
    kernel=Matern52(ell=(0.0514,), sf=0.444) + Matern52(ell=(0.387,), sf=0.703),
    resolution=0.008, s_n=0.00197, nugget=0.00933, a=0.103, delta=0.000999, v_0=0.00993,
    weights=(0.743, 0.501, 0.147),
)  # fmt: skip
"""A depth camera indoors, with few labels that are right: learned from the same frames; means over the axes."""

PRESETS: Mapping[str, BlockModel] = {
    "general": GENERAL,
    "indoor-rgbd": INDOOR_RGBD,
    "indoor-labels": INDOOR_LABELS,
    "outdoor-lidar": OUTDOOR_LIDAR,
}
"""The models by name."""


def with_vertical(model: BlockModel, axis: int) -> BlockModel:
    """Return a model for a world whose vertical is `axis` instead of z (2)."""
    theta, at = np.array(model.kernel.theta), 0
    for term in model.terms:
        if len(term.ell) >= 3:
            theta[[at + axis, at + 2]] = theta[[at + 2, at + axis]]
        at += len(term.ell) + 1
    return replace(model, kernel=model.kernel.with_theta(theta))
