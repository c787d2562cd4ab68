"""From labelled clouds to the arrays that a field takes."""

from __future__ import annotations

from zlib import crc32

import numpy as np

from semgp.blocks.arrays import F32, I64
from semgp.blocks.field import Field
from semgp.blocks.observations import DRAWS, Observations
from semgp.cloud import LabelledCloud
from semgp.errors import InputError

COLOURS = ("red", "green", "blue")


def add_cloud(field: Field, cloud: LabelledCloud) -> None:
    """Add the labelled points of a cloud to a field.

    Raises
    ------
    InputError
        A cloud without the features that the model asks for, or points a million voxels from the first.
    """
    field.add(cloud_inputs(cloud, field.model.features))


def cloud_inputs(cloud: LabelledCloud, features: tuple[str, ...]) -> Observations:
    """Return what a field takes of a cloud, with features by name.

    Raises
    ------
    InputError
        A feature that the cloud does not have.
    """
    columns = cloud_features(cloud, features)
    keep = cloud.labelled
    certain = cloud.covariances is None and cloud.pose_covariance is None
    return Observations(
        cloud.points[keep],
        None if cloud.labels is None else cloud.labels[keep],
        None if cloud.weights is None else cloud.class_weights[keep],
        columns[keep],
        None if cloud.confidence is None else cloud.confidence[keep],
        None if certain else cloud_variances(cloud)[keep].astype(np.float64),
        None if certain else cloud_draws(cloud)[keep],
    )


def cloud_variances(cloud: LabelledCloud) -> F32:
    """Return the variances (N, 3) of a cloud's positions along the axes of the world, 0 where they are certain."""
    covariances = cloud.position_covariances
    if covariances is None:
        return np.zeros((len(cloud), 3), dtype=np.float32)
    return np.diagonal(covariances, axis1=1, axis2=2).astype(np.float32)


def cloud_draws(cloud: LabelledCloud) -> I64:
    """Return one bit (N,) a point: the same for all where the pose is uncertain, else each its own, by a hash."""
    if cloud.pose_covariance is not None and cloud.T_world_sensor is not None:
        return np.full(len(cloud), 1 << crc32(cloud.T_world_sensor.tobytes()) % DRAWS, dtype=np.int64)
    steps = np.rint(cloud.points * 1e4).astype(np.int64) @ np.array([73_856_093, 19_349_663, 83_492_791])
    return np.asarray(np.left_shift(1, (steps >> 3) % DRAWS), dtype=np.int64)


def cloud_features(cloud: LabelledCloud, names: tuple[str, ...]) -> F32:
    """Return features (N, F) of a cloud by name: its own, or red, green and blue between 0 and 1.

    Raises
    ------
    InputError
        A name that the cloud does not have.
    """
    columns = np.empty((len(cloud), len(names)), dtype=np.float32)
    for i, name in enumerate(names):
        if cloud.features is not None and name in cloud.feature_names:
            columns[:, i] = cloud.features[:, cloud.feature_names.index(name)]
        elif cloud.colours is not None and name in COLOURS:
            columns[:, i] = cloud.colours[:, COLOURS.index(name)] / np.float32(255)
        else:
            colours = () if cloud.colours is None else COLOURS
            known = ", ".join((*cloud.feature_names, *colours)) or "none"
            raise InputError(f"the model asks for the feature {name!r}, the cloud has: {known}.")
    return columns
