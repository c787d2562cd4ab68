"""From labelled clouds to the arrays that a field takes."""

from __future__ import annotations

import numpy as np

from semgp.blocks.arrays import F32
from semgp.blocks.field import Field
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
    keep = cloud.labelled
    confidence = None if cloud.confidence is None else cloud.confidence[keep]
    variances = None if not _uncertain(cloud) else cloud_variances(cloud)[keep].astype(np.float64)
    features = cloud_features(cloud, field.model.features)
    if cloud.labels is not None:
        field.add(cloud.points[keep], cloud.labels[keep], None, features[keep], confidence, variances)
    elif cloud.weights is not None:
        field.add(cloud.points[keep], None, cloud.class_weights[keep], features[keep], confidence, variances)


def cloud_variances(cloud: LabelledCloud) -> F32:
    """Return the variances (N, 3) of a cloud's positions along the axes of the world, 0 where they are certain."""
    covariances = cloud.position_covariances
    if covariances is None:
        return np.zeros((len(cloud), 3), dtype=np.float32)
    return np.diagonal(covariances, axis1=1, axis2=2).astype(np.float32)


def _uncertain(cloud: LabelledCloud) -> bool:
    return cloud.covariances is not None or cloud.pose_covariance is not None


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
