"""What a mesh says at its vertices: labels and uncertainty."""

import numpy as np
from numpy.typing import ArrayLike

from semgp.classes import MISSING
from semgp.prediction import Prediction
from semgp.surfaces import surface
from tests.surfaces.fields import TWO, ball, solid
from tests.surfaces.meshes import needs_extra, quiet

pytestmark = quiet


@needs_extra
class TestWhatAMeshShows:
    def test_labels_and_uncertainty_are_the_maps(self) -> None:
        semantic_map = solid(ball, 1.1)
        mesh = surface(semantic_map, resolution=0.05)
        answer = semantic_map.query(mesh.vertices)
        at = np.flatnonzero(answer.observed)
        assert 0 < len(at) < len(mesh.vertices)
        np.testing.assert_array_equal(mesh.label[at], answer.label[at])
        np.testing.assert_array_equal(mesh.probability[at], answer.confidence[at])
        np.testing.assert_array_equal(mesh.entropy[at], answer.entropy[at])
        assert mesh.variance is not None
        np.testing.assert_array_equal(mesh.variance[at], 1 + mesh.label[at] + mesh.vertices[at, 0] ** 2)

    def test_where_labels_lack_it_asks_within(self) -> None:
        mesh = surface(solid(ball, 1.1), resolution=0.05)
        assert np.mean(mesh.label == MISSING) < 0.02
        away = (np.abs(mesh.vertices[:, 2]) > 0.05) & (mesh.label != MISSING)
        np.testing.assert_array_equal(mesh.label[away], mesh.vertices[away, 2] > 0)
        np.testing.assert_array_equal(mesh.colours[away], TWO.palette[mesh.label[away]])

    def test_a_class(self) -> None:
        high = surface(solid(ball, 1.1), "high", resolution=0.05)
        dome = high.vertices[:, 2] > 0.1
        np.testing.assert_allclose(ball(high.vertices[dome]), 0, atol=0.01)
        assert high.vertices[:, 2].min() > -0.01
        assert set(high.label[dome]) <= {1, MISSING}
        below = high.vertices[~dome]
        assert ball(below).max() < 0.35  # the border between the classes is left open further in
        low = surface(solid(ball, 1.1), "low", resolution=0.05)
        assert low.vertices[:, 2].max() < 0.01

    def test_vertices_without_any_label_are_grey(self) -> None:
        semantic_map = solid(ball, 1.1)
        answer = semantic_map.query

        def unlabelled(points: ArrayLike) -> Prediction:
            p = answer(points)
            return Prediction(TWO, p.probability, np.zeros(len(p), dtype=bool), occupancy=p.occupancy)

        semantic_map.query = unlabelled  # type: ignore[method-assign]
        mesh = surface(semantic_map, resolution=0.1)
        assert (mesh.label == MISSING).all()
        assert mesh.variance is None
        assert len(np.unique(mesh.colours)) == 1
