"""A triangle mesh that knows what it shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.picture.colour import by_class
from semgp.upward import Up

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, and what the map says of their V vertices.

    Parameters
    ----------
    classes : Classes
        The classes that the labels speak of.
    vertices : (V, 3) float64 array
        Metres, world frame.
    faces : (F, 3) int32 array
        Vertices of each triangle, anticlockwise as seen from free space.
    normals : (V, 3) float64 array
        Unit vectors that point to free space.
    label : (V,) int32 array
        Most probable class; `MISSING` where the map has no labels.
    probability : (V,) float array
        Probability of that class.
    entropy : (V,) float array
        Entropy of the class probabilities, in nats.
    variance : (V,) float array, optional
        Variance of the map's belief about that class, see `Prediction`; None where the map has none.
    up : str, optional
        The axis of the world that points upwards, see `semgp.upward`.

    Raises
    ------
    InputError
        Arrays whose shapes do not agree, or faces of vertices that do not exist.
    """

    classes: Classes
    vertices: F64
    faces: NDArray[np.int32]
    normals: F64
    label: NDArray[np.int32]
    probability: NDArray[np.floating]
    entropy: NDArray[np.floating]
    variance: NDArray[np.floating] | None = None
    up: Up = "z"

    def __post_init__(self) -> None:
        n = len(self.vertices)
        for name in ("vertices", "normals", "label", "probability", "entropy", "variance"):
            value = getattr(self, name)
            shape = (n, 3) if name in ("vertices", "normals") else (n,)
            if value is not None and value.shape != shape:
                raise InputError(f"{name} must have shape {shape}, not {value.shape}.")
        if self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise InputError(f"faces must have shape (F, 3), not {self.faces.shape}.")
        if self.faces.size and not (self.faces.min() >= 0 and self.faces.max() < n):
            raise InputError(f"faces must name vertices from 0 to {n - 1}.")

    @property
    def colours(self) -> NDArray[np.uint8]:
        """Colour (V, 3) of each vertex's class; grey where it is missing."""
        return by_class(self.label, self.classes)

    @property
    def area(self) -> float:
        """Area in square metres."""
        return float(np.linalg.norm(face_areas(self.vertices, self.faces), axis=1).sum())


def face_areas(vertices: F64, faces: NDArray[np.integer]) -> F64:
    """Return the area of each face as a vector (F, 3) along its normal."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    return np.asarray(np.cross(b - a, c - a) / 2)


def vertex_normals(vertices: F64, faces: NDArray[np.integer]) -> F64:
    """Return unit normals (V, 3): the mean of the faces that meet at a vertex, weighted by their areas."""
    areas = face_areas(vertices, faces)
    sums = np.stack(
        [np.bincount(faces.ravel(), np.repeat(along, 3), minlength=len(vertices)) for along in areas.T], axis=1
    )
    return np.asarray(sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), np.finfo(float).tiny))
