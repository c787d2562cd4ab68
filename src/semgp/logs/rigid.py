"""Poses as rows of numbers, the way that ROS writes them: position and unit quaternion."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def row_of(position: Any, rotation: Any) -> NDArray[np.float64] | None:
    """Return x, y, z and the unit quaternion of a pose or transform; None where it is none, as tf2 sees it."""
    row = np.array(
        [position.x, position.y, position.z, rotation.x, rotation.y, rotation.z, rotation.w], np.float64
    )
    if not np.isfinite(row).all() or abs(row[3:] @ row[3:] - 1) > 1e-2:
        return None
    row[3:] /= np.linalg.norm(row[3:])
    return row


def between(a: NDArray[np.float64], b: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Return the row (7,) that lies at a share of the way from one to another: straight line and slerp."""
    row = (1 - share) * a + share * b
    p, q = a[3:], b[3:] if a[3:] @ b[3:] >= 0 else -b[3:]
    angle = np.arctan2(np.linalg.norm(q - p), np.linalg.norm(q + p)) * 2  # well conditioned near 0 and pi
    if angle > 0:
        row[3:] = (np.sin((1 - share) * angle) * p + np.sin(share * angle) * q) / np.sin(angle)
    else:
        row[3:] = p
    return row


def transform(row: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rigid transform (4, 4) of a position and a unit quaternion x, y, z, w."""
    x, y, z, w = row[3:]
    T = np.eye(4)
    T[:3, :3] = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    T[:3, 3] = row[:3]
    return T


def quaternion(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit quaternion x, y, z, w of the rotation nearest to a matrix (3, 3).

    It is the eigenvector of the greatest eigenvalue of a 4 x 4 matrix of R's entries (Bar-Itzhack, 2000).
    """
    K = np.array(
        [
            [R[0, 0] - R[1, 1] - R[2, 2], R[1, 0] + R[0, 1], R[2, 0] + R[0, 2], R[2, 1] - R[1, 2]],
            [R[1, 0] + R[0, 1], R[1, 1] - R[0, 0] - R[2, 2], R[2, 1] + R[1, 2], R[0, 2] - R[2, 0]],
            [R[2, 0] + R[0, 2], R[2, 1] + R[1, 2], R[2, 2] - R[0, 0] - R[1, 1], R[1, 0] - R[0, 1]],
            [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], R[0, 0] + R[1, 1] + R[2, 2]],
        ]
    )
    q = np.linalg.eigh(K)[1][:, -1]
    return np.asarray(q if q[3] >= 0 else -q)
