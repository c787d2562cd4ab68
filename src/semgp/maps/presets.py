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

GENERAL = BlockModel()
"""Labels of middling quality, metres: sites of five centimetres, length scales of 0.15 and 1 m."""

OUTDOOR_LIDAR = BlockModel(
    kernel=Matern52(ell=(0.447, 0.447, 0.118), sf=0.191) + Matern52(ell=(5.25, 5.25, 1.28), sf=0.697),
    resolution=0.2, s_n=0.295, nugget=0.0943, a=0.231, delta=0.00632, v_0=0.0437, weights=(0.417, 0.36, 0.168),
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
