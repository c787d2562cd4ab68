"""Occupancy and files against OctoMap itself (octomap-python), on synthetic and on real clouds."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.octomap import Cells, SemanticOctoMap, SensorModel
from semgp.readers import open_scans

oracle: Any = pytest.importorskip("octomap", reason="octomap-python is not installed")

CLASSES = Classes(("floor", "wall", "chair"))
WHITE = (255, 255, 255)


def pose(seed: int, reach: float = 0.5) -> NDArray[np.float64]:
    """Return any rigid transform."""
    rng = np.random.default_rng(seed)
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    T = np.eye(4)
    T[:3, :3] = Q * np.linalg.det(Q)
    T[:3, 3] = rng.uniform(-reach, reach, 3)
    return T


def moved(cloud: LabelledCloud, T: NDArray[np.float64]) -> LabelledCloud:
    return replace(cloud, points=cloud.points @ T[:3, :3].T + T[:3, 3], T_world_sensor=T)


def synthetic(seed: int, n: int = 1500) -> LabelledCloud:
    """Return points on the walls of a box around the sensor, and some inside it."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(n, 3))
    points = directions / np.abs(directions).max(axis=1, keepdims=True) * rng.choice([0.7, 1.3, 1.7], (n, 1))
    labels = rng.integers(-1, 3, n, dtype=np.int32)
    colours = rng.integers(0, 255, (n, 3), dtype=np.uint8)
    return moved(LabelledCloud(points, CLASSES, labels, colours=colours), pose(seed))


def build(
    clouds: Sequence[LabelledCloud], resolution: float, max_range: float | None = None, **options: bool
) -> tuple[SemanticOctoMap, Any]:
    """Return both maps of the same clouds; `lazy_eval` keeps the oracle from pruning."""
    discretize, lazy_eval = options.get("discretize", False), options.get("lazy_eval", False)
    ours = SemanticOctoMap(clouds[0].classes, resolution, max_range=max_range, discretize=discretize)
    theirs = oracle.OcTree(resolution)
    for cloud in clouds:
        ours.update(cloud)
        assert cloud.origin is not None
        theirs.insertPointCloud(
            cloud.points, cloud.origin.copy(), max_range or -1.0, lazy_eval=lazy_eval, discretize=discretize
        )
    if lazy_eval:
        theirs.updateInnerOccupancy()
    return ours, theirs


def rows_of(tree: Any, resolution: float) -> NDArray[np.float64]:
    """Return the oracle's leaves in order: centres and sizes in half voxels, and log-odds."""
    rows = [
        (*np.rint(leaf.getCoordinate() / resolution * 2), round(leaf.getSize() / resolution), leaf.getValue())
        for leaf in tree.begin_leafs()
    ]
    return in_order(np.array(rows).reshape(-1, 5))


def rows_of_cells(cells: Cells, resolution: float) -> NDArray[np.float64]:
    return in_order(
        np.column_stack(
            [np.rint(cells.centres / resolution * 2), np.rint(cells.sizes / resolution), cells.log_odds]
        )
    )


def in_order(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    return rows[np.lexsort(rows.T[:4])]


def assert_same_leaves(cells: Cells, tree: Any, resolution: float) -> None:
    ours, theirs = rows_of_cells(cells, resolution), rows_of(tree, resolution)
    np.testing.assert_array_equal(ours[:, :4], theirs[:, :4])
    np.testing.assert_allclose(ours[:, 4], theirs[:, 4], rtol=1e-6, atol=1e-6)


def assert_same_map(
    clouds: Sequence[LabelledCloud], resolution: float, discretize: bool, max_range: float | None
) -> None:
    """Compare the pruned trees, the trees before pruning, and free, occupied and unknown space at points."""
    ours, theirs = build(clouds, resolution, max_range, discretize=discretize)
    assert_same_leaves(ours.leaves(), theirs, resolution)
    _, unpruned = build(clouds, resolution, max_range, discretize=discretize, lazy_eval=True)
    assert_same_leaves(ours.leaves(pruned=False), unpruned, resolution)
    points = ours.leaves().centres
    rng = np.random.default_rng(0)
    points = rng.uniform(points.min(axis=0) - 1, points.max(axis=0) + 1, (500, 3)).astype(np.float32).astype(float)
    for depth in (16, 15, 14, 12, 9, 4, 1):
        found = ours.query_occupancy(points, depth)
        nodes = [theirs.search(point, depth) for point in points]
        assert found.known.tolist() == [is_known(node) for node in nodes]
        known = [node for node in nodes if is_known(node)]
        np.testing.assert_allclose(found.log_odds[found.known], [node.getLogOdds() for node in known], rtol=1e-6)
        assert found.occupied[found.known].tolist() == [theirs.isNodeOccupied(node) for node in known]
    unknown = ours.unknown(points.min(axis=0), points.max(axis=0))
    for centre in unknown.centres[::25]:
        assert not is_known(theirs.search(centre))


def is_known(node: Any) -> bool:
    try:
        node.getLogOdds()
    except oracle.NullPointerException:
        return False
    return True


@pytest.mark.parametrize("discretize", [False, True])
@pytest.mark.parametrize("max_range", [None, 1.2])
class TestOccupancy:
    def test_synthetic_clouds(self, discretize: bool, max_range: float | None) -> None:
        assert_same_map([synthetic(seed) for seed in range(3)], 0.08, discretize, max_range)

    def test_depth_camera_frames(self, data_dir: Path, discretize: bool, max_range: float | None) -> None:
        frames = open_scans(data_dir / "nyu")
        clouds = [moved(frames[i][::300], pose(i)) for i in (0, 1, 1)]
        assert_same_map(clouds, 0.06, discretize, max_range)

    def test_lidar_scans(self, data_dir: Path, discretize: bool, max_range: float | None) -> None:
        scans = open_scans(data_dir / "semantickitti_08", world="camera")
        clouds = [scans[i][::150] for i in range(3)]
        assert_same_map(clouds, 0.5, discretize, max_range and 20 * max_range)


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.02, 0.1, 0.25, 1 / 3, 1.0]),
    st.sampled_from([None, 0.8, 3.0]),
    st.booleans(),
    st.booleans(),
)
def test_rays_through_corners_and_along_borders(
    seed: int, resolution: float, max_range: float | None, discretize: bool, on_grid: bool
) -> None:
    """Ties: the traversal must break them as OctoMap does."""
    rng = np.random.default_rng(seed)
    ends = rng.integers(-15, 16, (13, 3)) * (resolution / 2 if on_grid else rng.uniform(0.3, 1) * resolution)
    T = np.eye(4)
    T[:3, 3] = ends[0]
    ours, theirs = build(
        [LabelledCloud(ends[1:].astype(np.float64), CLASSES, T_world_sensor=T)],
        resolution,
        None if max_range is None else max_range * resolution * 4,
        discretize=discretize,
    )
    assert_same_leaves(ours.leaves(), theirs, resolution)


def test_many_updates_clamp_alike() -> None:
    clouds = [synthetic(seed % 3, 300) for seed in range(12)]
    ours, theirs = build(clouds, 0.2)
    assert_same_leaves(ours.leaves(), theirs, 0.2)
    sensor = SensorModel()
    for name, value in (
        ("getProbHitLog", sensor.hit),
        ("getProbMissLog", sensor.miss),
        ("getClampingThresMinLog", sensor.clamp_min),
        ("getClampingThresMaxLog", sensor.clamp_max),
        ("getOccupancyThresLog", sensor.threshold),
    ):
        assert math.isclose(getattr(theirs, name)(), math.log(value / (1 - value)), abs_tol=1e-6)


def test_other_sensor_models() -> None:
    sensor = SensorModel(hit=0.9, miss=0.45, clamp_min=0.3, clamp_max=0.95, threshold=0.6)
    ours, theirs = SemanticOctoMap(CLASSES, 0.1, sensor=sensor), oracle.OcTree(0.1)
    theirs.setProbHit(0.9)
    theirs.setProbMiss(0.45)
    theirs.setClampingThresMin(0.3)
    theirs.setClampingThresMax(0.95)
    theirs.setOccupancyThres(0.6)
    for cloud in [synthetic(0), synthetic(1), synthetic(0), synthetic(2)]:
        ours.update(cloud)
        assert cloud.origin is not None
        theirs.insertPointCloud(cloud.points, cloud.origin.copy())
    assert_same_leaves(ours.leaves(), theirs, 0.1)
    occupied = [leaf.getCoordinate() for leaf in theirs.begin_leafs() if leaf.getOccupancy() >= 0.6]
    assert len(ours.occupied()) == len(occupied)


class TestFiles:
    """The trees of files that one side wrote and the other reads."""

    @pytest.fixture
    def both(self) -> tuple[SemanticOctoMap, Any]:
        return build([synthetic(seed) for seed in range(4)], 0.1)

    def test_ot_to_octomap(self, both: tuple[SemanticOctoMap, Any], tmp_path: Path) -> None:
        ours, theirs = both
        ours.write(tmp_path / "map.ot")
        read = oracle.OcTree.read(str(tmp_path / "map.ot").encode())
        assert read.size() == theirs.size()
        assert_same_leaves(ours.leaves(), read, 0.1)
        assert (tmp_path / "map.ot").read_bytes() == theirs.write()  # to the last byte

    def test_bt_to_octomap(self, both: tuple[SemanticOctoMap, Any], tmp_path: Path) -> None:
        ours, theirs = both
        ours.write(tmp_path / "map.bt")
        read = oracle.OcTree(0.5)
        assert read.readBinary(str(tmp_path / "map.bt").encode())
        written = theirs.writeBinary()  # which makes the oracle's tree binary, too
        assert (tmp_path / "map.bt").read_bytes() == written
        np.testing.assert_array_equal(rows_of(read, 0.1), rows_of(theirs, 0.1))
        assert read.getResolution() == 0.1

    def test_ot_from_octomap(self, both: tuple[SemanticOctoMap, Any], tmp_path: Path) -> None:
        ours, theirs = both
        assert theirs.write(str(tmp_path / "map.ot").encode())
        read = SemanticOctoMap.read(tmp_path / "map.ot", CLASSES)
        assert read.resolution == 0.1
        np.testing.assert_array_equal(rows_of_cells(read.leaves(), 0.1), rows_of_cells(ours.leaves(), 0.1))
        cloud = synthetic(7)
        ours.update(cloud)
        read.update(cloud)
        np.testing.assert_array_equal(read.leaves().log_odds, ours.leaves().log_odds)

    def test_bt_from_octomap(self, both: tuple[SemanticOctoMap, Any], tmp_path: Path) -> None:
        _, theirs = both
        assert theirs.writeBinary(str(tmp_path / "map.bt").encode())
        read = SemanticOctoMap.read(tmp_path / "map.bt", CLASSES)
        assert_same_leaves(read.leaves(), theirs, 0.1)

    def test_unpruned_ot_from_octomap(self, tmp_path: Path) -> None:
        ours, theirs = build([synthetic(seed) for seed in range(3)], 0.1, lazy_eval=True)
        assert theirs.write(str(tmp_path / "map.ot").encode())
        read = SemanticOctoMap.read(tmp_path / "map.ot", CLASSES)
        np.testing.assert_array_equal(rows_of_cells(read.leaves(), 0.1), rows_of_cells(ours.leaves(), 0.1))

    @pytest.mark.parametrize("colours", ["mean", "class"])
    def test_coloured_ot_to_octomap_and_back(self, colours: Any, tmp_path: Path) -> None:
        ours, theirs = build([synthetic(seed) for seed in range(4)], 0.1)
        ours.write(tmp_path / "map.ot", colours)
        tree = oracle.ColorOcTree.read(str(tmp_path / "map.ot").encode())
        n_coloured = 0
        for leaf in tree.begin_leafs():
            centre, colour = np.asarray([leaf.getCoordinate()]), tuple(leaf.getColor())
            expected = WHITE
            if leaf.getValue() >= 0:
                assert round(leaf.getSize() / 0.1) == 1
                if colours == "mean":
                    mean, known = ours.query_colours(centre)
                    expected = tuple(mean[0].tolist()) if known[0] else WHITE
                else:
                    label = int(ours.query(centre).label[0])
                    expected = CLASSES.colours[label] if label >= 0 else WHITE
            assert colour == expected
            n_coloured += colour != WHITE
        assert n_coloured > 100
        assert tree.search(np.zeros(3), 1).getLogOdds() == theirs.search(np.zeros(3), 1).getLogOdds()
        before = tree.write()
        tree.updateInnerOccupancy()  # averages the colours of children, as the file already has it
        assert tree.write() == before
        read = SemanticOctoMap.read(tmp_path / "map.ot", CLASSES)
        np.testing.assert_array_equal(rows_of_cells(read.leaves(), 0.1), rows_of_cells(ours.leaves(), 0.1))
        if colours == "mean":
            points = ours.occupied(pruned=False).centres
            for found, expected_of in zip(read.query_colours(points), ours.query_colours(points)):
                np.testing.assert_array_equal(found, expected_of)
