"""Classes and colours of voxels."""

from collections import defaultdict
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.classes import MISSING, Classes
from semgp.octomap import SemanticOctoMap
from tests.octomap.clouds import CLASSES, built, random_cloud, seen_from, voxels_of


class TestClasses:
    @settings(max_examples=25, deadline=None)
    @given(st.integers(0, 2**32 - 1), st.booleans())
    def test_a_voxel_averages_its_labels(self, seed: int, soft: bool) -> None:
        rng = np.random.default_rng(seed)
        clouds = [
            seen_from((0, 0, 0), rng.uniform(-0.4, 0.4, (150, 3)), **random_labels(rng, 150, soft))
            for _ in range(2)
        ]
        mass: dict[tuple[int, ...], NDArray[np.float64]] = defaultdict(lambda: np.zeros(3))
        for cloud in clouds:
            for voxel, weight in zip(voxels_of(cloud.points, 0.1), cloud.class_weights):
                mass[voxel] += weight
        points = np.vstack([clouds[0].points, rng.uniform(-0.5, 0.5, (50, 3))])
        prediction = built(*clouds).query(points)
        expected = np.array([mass[voxel] for voxel in voxels_of(points, 0.1)])
        observed = expected.sum(axis=1) > 0
        expected[~observed] = 1
        np.testing.assert_array_equal(prediction.observed, observed)
        np.testing.assert_allclose(
            prediction.probability, expected / expected.sum(axis=1, keepdims=True), atol=1e-5
        )

    def test_unlabelled_points_tell_of_occupancy_and_colour_only(self) -> None:
        points = [[0.95, 0.05, 0.05], [0.95, 0.55, 0.05]]
        colours = [[10, 20, 30], [40, 50, 60]]
        octomap = built(seen_from((0, 0, 0), points, labels=[2, MISSING], colours=colours))
        assert octomap.query_occupancy(points).occupied.all()
        prediction = octomap.query(points)
        assert prediction.observed.tolist() == [True, False]
        assert prediction.label.tolist() == [2, MISSING]
        np.testing.assert_allclose(prediction.probability, np.array([[0, 0, 3], [1, 1, 1]]) / 3)
        found, known = octomap.query_colours([*points, [0.5, 0, 0]])
        assert known.tolist() == [True, True, False]
        assert found[:2].tolist() == colours

    def test_occupancy_does_not_depend_on_labels(self) -> None:
        cloud = random_cloud(10)
        bare = built(replace(cloud, labels=None, colours=None))
        labelled = built(cloud)
        np.testing.assert_array_equal(bare.leaves().log_odds, labelled.leaves().log_odds)
        np.testing.assert_array_equal(bare.leaves().centres, labelled.leaves().centres)

    def test_colours_are_averaged_whether_or_not_each_cloud_has_them(self) -> None:
        point = [[0.95, 0.05, 0.05]]
        plain = seen_from((0, 0, 0), [[0.55, 0.05, 0.05], *point], labels=[0, 1])
        octomap = built(plain)
        for colour in ([10, 0, 255], [20, 1, 255]):
            octomap.update(seen_from((0, 0, 0), point, colours=[colour]))
        octomap.update(plain)
        colours, known = octomap.query_colours([*point, [0.55, 0.05, 0.05]])
        assert known.tolist() == [True, False]
        assert colours[0].tolist() == [15, 0, 255]  # 0.5 rounds to even

    def test_memory_follows_the_classes_met_not_those_there_are(self) -> None:
        cloud = random_cloud(11)
        many = Classes.numbered(1000)
        few = SemanticOctoMap(CLASSES, 0.1)
        few.update(cloud)
        wide = SemanticOctoMap(many, 0.1)
        wide.update(replace(cloud, classes=many, labels=np.where(cloud.hard_labels == 2, 999, cloud.hard_labels)))
        assert wide.info()["label_bytes"] == few.info()["label_bytes"]
        assert wide.query(cloud.points).label.max() == 999

    def test_positions_are_the_labelled_voxels(self) -> None:
        cloud = random_cloud(12)
        octomap = built(cloud)
        assert set(voxels_of(octomap.positions, 0.1)) == set(voxels_of(cloud.points[cloud.labelled], 0.1))
        assert len(octomap.positions) == octomap.info()["labelled_voxels"]


def random_labels(rng: np.random.Generator, n: int, soft: bool) -> dict[str, NDArray[np.number]]:
    if not soft:
        return {"labels": rng.integers(-1, 3, n)}
    return {"weights": rng.random((n, 3)) * rng.integers(0, 2, (n, 3)) * rng.integers(0, 2, (n, 1))}
