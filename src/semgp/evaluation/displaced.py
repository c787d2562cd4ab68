"""Clouds elsewhere than they were: in another frame, or where a wrong pose puts them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgp.cloud import LabelledCloud
from semgp.errors import InputError


def moved(cloud: LabelledCloud, T: NDArray[np.float64]) -> LabelledCloud:
    """Return a cloud whose points and pose have been moved by a rigid transform (4, 4).

    Raises
    ------
    InputError
        A cloud without a pose, or with covariances.
    """
    if cloud.T_world_sensor is None or cloud.position_covariances is not None:
        raise InputError("what is moved here needs a T_world_sensor, and certain positions.")
    return replace(cloud, points=cloud.points @ T[:3, :3].T + T[:3, 3], T_world_sensor=T @ cloud.T_world_sensor)


def displaced(cloud: LabelledCloud, metres: float, degrees: float, rng: np.random.Generator) -> LabelledCloud:
    """Return a scan as a wrong pose places it, with the covariance of that error.

    Parameters
    ----------
    cloud : LabelledCloud
        With a pose.
    metres, degrees : float
        Standard deviations of the error, along and about each axis of the world, about the sensor.
    rng : numpy.random.Generator
        Source of the error.

    Raises
    ------
    InputError
        A cloud without a pose, or with covariances.
    """
    if cloud.origin is None:
        raise InputError("a pose that is to be wrong must be there: give the cloud its T_world_sensor.")
    error = np.eye(4)
    error[:3, :3] = Rotation.from_rotvec(np.radians(degrees) * rng.normal(size=3)).as_matrix()
    error[:3, 3] = cloud.origin - error[:3, :3] @ cloud.origin + metres * rng.normal(size=3)
    covariance = np.diag([metres**2] * 3 + [np.radians(degrees) ** 2] * 3)
    return replace(moved(cloud, error), pose_covariance=covariance)
