"""What tests of meshes share: whether they are closed, and what they need to be made."""

from importlib.util import find_spec

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.classes import MISSING, Classes
from semgp.surfaces import Mesh
from tests.surfaces.fields import TWO

F64 = NDArray[np.float64]


needs_extra = pytest.mark.skipif(
    find_spec("skimage") is None, reason="the extra mesh (scikit-image) is not installed"
)


quiet = pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array:DeprecationWarning:skimage")


def directed_edges(faces: NDArray[np.integer]) -> NDArray[np.int64]:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)


def assert_watertight(faces: NDArray[np.integer]) -> None:
    """Each edge belongs to two faces, which pass it in opposite directions."""
    edges = directed_edges(faces)
    there = np.unique(edges, axis=0)
    assert len(there) == len(edges)
    np.testing.assert_array_equal(there, np.unique(edges[:, ::-1], axis=0))


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] - mesh.vertices[0] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def in_order(points: F64) -> F64:
    return points[np.lexsort(np.round(points, 6).T)]


def same_faces(mesh: Mesh) -> set[frozenset[tuple[float, ...]]]:
    """Faces by where their corners are, whatever the numbers of the vertices."""
    corners = np.round(mesh.vertices, 6) + 0.0
    return {frozenset(tuple(corners[v].tolist()) for v in face) for face in mesh.faces}


def triangle(at: F64, classes: Classes = TWO) -> Mesh:
    return Mesh(
        classes,
        vertices=at + np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]]),
        faces=np.array([[0, 1, 2]], dtype=np.int32),
        normals=np.array([[0.0, 0, 1]] * 3),
        label=np.array([0, 1, MISSING], dtype=np.int32),
        probability=np.array([0.9, 0.8, 0.5]),
        entropy=np.array([0.1, 0.2, 0.3]),
        variance=np.array([1.0, 2.0, 3.0]),
    )
