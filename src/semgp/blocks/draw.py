"""Draw patches: blocks of a map of some clouds, with labels of other clouds in their leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from semgp.blocks.field import Field
from semgp.blocks.inputs import add_cloud, cloud_features, cloud_variances
from semgp.blocks.model import BlockModel
from semgp.blocks.patches import Patch, patch
from semgp.cloud import LabelledCloud

Trial = tuple[Sequence[LabelledCloud], Sequence[LabelledCloud]]
"""Clouds that give a map its labels, and clouds that judge it."""

HELD_OUT = 32
"""At most so many of the judges' points in a patch."""


def draw_patches(
    model: BlockModel,
    training: Sequence[LabelledCloud],
    judges: Sequence[LabelledCloud],
    n: int,
    rng: np.random.Generator,
) -> list[Patch]:
    """Return the blocks of a map of the training clouds that hold n of the judges' points, drawn at random.

    A block that was drawn twice comes once, with at most `HELD_OUT` of the judges' points in its leaf.
    """
    # the members are enough: a vote need not be solved
    field = Field(replace(model, posterior="vote", weights=(0.0, 0.0, 1.0)), len(training[0].classes))
    for cloud in training:
        add_cloud(field, cloud)
    labelled = [c[c.labelled] for c in judges]
    points = np.concatenate([c.points for c in labelled])
    labels = np.concatenate([c.hard_labels for c in labelled])
    features = np.concatenate([cloud_features(c, model.features) for c in labelled])
    variances = np.concatenate([cloud_variances(c) for c in labelled])
    if not len(points) or not len(field.sites):
        return []
    shuffled = rng.permutation(len(points))
    drawn = field.home(points[shuffled[:n]], solve=True)[0]
    block, local = field.home(points[shuffled])
    order = np.argsort(block, kind="stable")
    ranked = block[order]
    wanted = np.unique(drawn[drawn >= 0])
    patches = []
    for piece, which, inside in field.store.by_piece(wanted):
        for b, place in zip(wanted[which], inside):
            begin, end = np.searchsorted(ranked, [b, b + 1])
            here = order[begin : min(end, begin + HELD_OUT)]
            if piece is not None and len(here) and piece.solved.n[place]:
                rows = shuffled[here]
                Y = np.concatenate([local[here], features[rows]], axis=1)
                patches.append(patch(piece.solved, int(place), Y, variances[rows], labels[rows]))
    return patches
