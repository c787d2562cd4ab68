"""Bags that semgp writes, read by rosbags, octomap-python and semgp itself."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.baselines.knn import KNNMap
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.logs.maps import write_map
from semgp.logs.reader import open_log
from semgp.logs.recording import recording, write_clouds
from semgp.octomap import SemanticOctoMap
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.readers import open_scans
from semgp.scene import DepthCamera, synthetic_room
from tests.log_samples import STORAGES, pose

ROOM = synthetic_room(views=24, camera=DepthCamera(width=40, height=30))
CLASSES = Classes(("road", "parked car", "tree"))


def soft_clouds() -> list[LabelledCloud]:
    rng = np.random.default_rng(0)
    weights = rng.dirichlet(np.ones(3), 20).astype(np.float32)
    weights[::4] = 0
    points = rng.normal(scale=20, size=(20, 3))
    features = rng.normal(size=(20, 1)).astype(np.float32)
    return [
        LabelledCloud(
            points,
            CLASSES,
            weights=weights,
            features=features,
            feature_names=("intensity",),
            T_world_sensor=pose(k, 0, 1, yaw=k),
            stamp=50.0 + k,
        )
        for k in range(3)
    ]


@pytest.mark.parametrize("name", STORAGES)
def test_clouds_come_back(name: str, tmp_path: Path) -> None:
    clouds = [ROOM.scan(k).observed for k in range(3)]
    write_clouds(tmp_path / name, clouds, frame="room", sqlite="sqlite" in name)
    scans = open_log(tmp_path / name)
    assert [cloud.classes.names for cloud in scans] == [ROOM.classes.names] * 3
    for cloud, back in zip(clouds, scans):
        np.testing.assert_allclose(back.points, cloud.points, atol=1e-6)
        np.testing.assert_array_equal(back.labels, cloud.labels)
        np.testing.assert_array_equal(back.colours, cloud.colours)
        np.testing.assert_allclose(back.T_world_sensor, cloud.T_world_sensor, atol=1e-9)  # type: ignore[arg-type]


def test_soft_labels_features_and_stamps_come_back(tmp_path: Path) -> None:
    clouds = soft_clouds()
    write_clouds(tmp_path / "run.bag", clouds)
    scans = open_log(tmp_path / "run.bag", features=("intensity",))
    assert [scan.stamp for scan in scans] == [50, 51, 52]
    for cloud, back in zip(clouds, scans):
        np.testing.assert_array_equal(back.weights, cloud.weights)
        np.testing.assert_array_equal(back.features, cloud.features)
        assert back.feature_names == ("intensity",)


def test_the_numbers_of_the_bags_own_classes_are_no_raw_ids(tmp_path: Path) -> None:
    cloud = ROOM.scan(0).observed
    write_clouds(tmp_path / "run.mcap", [cloud])
    ids = tuple((10 * (c + 1),) for c in range(len(ROOM.classes)))
    same = Classes(ROOM.classes.names, ROOM.classes.colours, ids=ids)
    np.testing.assert_array_equal(open_log(tmp_path / "run.mcap", classes=same)[0].hard_labels, cloud.hard_labels)
    coarse = Classes(("even", "odd"), ids=(tuple(range(0, 13, 2)), tuple(range(1, 13, 2))))
    found = open_log(tmp_path / "run.mcap", classes=coarse)[0].hard_labels
    np.testing.assert_array_equal(found, np.where(cloud.labelled, cloud.hard_labels % 2, -1))


def test_points_far_away_keep_their_millimetres(tmp_path: Path) -> None:
    far = np.array([4.6e5, 5.4e6, 120.0])
    points = far + np.random.default_rng(0).uniform(-100, 100, (50, 3))
    cloud = LabelledCloud(points, CLASSES, labels=np.zeros(50, np.int32))
    write_clouds(tmp_path / "far.mcap", [cloud])
    (back,) = open_log(tmp_path / "far.mcap")
    np.testing.assert_allclose(back.points, points, rtol=0, atol=1e-5)
    assert back.T_world_sensor is None
    with_pose = LabelledCloud(points, CLASSES, labels=np.zeros(50, np.int32), T_world_sensor=pose(*far))
    write_clouds(tmp_path / "pose.mcap", [with_pose])
    (back,) = open_log(tmp_path / "pose.mcap")
    np.testing.assert_allclose(back.points, points, rtol=0, atol=1e-5)
    semantic_map = KNNMap(CLASSES)
    semantic_map.update(cloud)
    write_map(tmp_path / "map.mcap", semantic_map, points)
    columns, message = columns_by_hand(tmp_path / "map.mcap", "/semantic_map")
    assert (columns["x"].dtype.name, message.header.frame_id) == ("float32", "map_semantic_map")
    (back,) = open_log(tmp_path / "map.mcap")
    np.testing.assert_allclose(back.points, points, rtol=0, atol=1e-5)
    assert back.T_world_sensor is None  # the origin of the frame near by is no sensor


def test_features_that_no_field_can_be_called(tmp_path: Path) -> None:
    cloud = soft_clouds()[0]
    write_clouds(tmp_path / "run.mcap", [replace(cloud, feature_names=("feature 0",))])
    assert open_log(tmp_path / "run.mcap", features=("feature_0",))[0].feature_names == ("feature_0",)
    for name in ("x", "label", "p_road", "ä"):
        with pytest.raises(InputError):
            write_clouds(tmp_path / "other.mcap", [replace(cloud, feature_names=(name,))])


def columns_by_hand(path: Path, topic: str) -> tuple[dict[str, NDArray[Any]], Any]:
    """Read a PointCloud2 with rosbags and a structured array, nothing of semgp's."""
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        (connection,) = [c for c in reader.connections if c.topic == topic]
        ((_, _, raw),) = reader.messages([connection])
        message: Any = reader.deserialize(raw, connection.msgtype)
    kinds = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
    layout = [(f.name, "<" + kinds[f.datatype], (f.count,)) for f in message.fields]
    rows = np.frombuffer(message.data.tobytes(), dtype=layout)
    assert len(rows) == message.width * message.height
    assert rows.itemsize == message.point_step
    return {name: rows[name][:, 0] for name in rows.dtype.names or ()}, message


@pytest.mark.parametrize("name", ["map.mcap", "map.db3", "map.bag"])
def test_a_prediction_in_other_hands(name: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(7, 3))
    observed = np.arange(7) != 3
    p = rng.dirichlet(np.ones(3), 7)
    variance = rng.uniform(1, 2, (7, 3))
    occupancy = OccupancyPrediction(rng.uniform(size=7), np.arange(7) != 2)
    prediction = Prediction(CLASSES, p, observed, variance=variance, occupancy=occupancy)
    with recording(tmp_path / name, frame="world") as bag:
        bag.prediction(points, prediction)
    columns, message = columns_by_hand(tmp_path / name, "/semantic_map")
    assert message.header.frame_id == "world"
    np.testing.assert_array_equal(np.stack([columns[c] for c in "xyz"], axis=1), points.astype(np.float32))
    np.testing.assert_array_equal(columns["label"], prediction.label)
    p_columns = np.stack([columns[c] for c in ("p_road", "p_parked_car", "p_tree")], axis=1)
    np.testing.assert_array_equal(p_columns, p.astype(np.float32))
    np.testing.assert_allclose(columns["variance"], variance[np.arange(7), p.argmax(axis=1)], rtol=1e-6)
    np.testing.assert_allclose(columns["entropy"], -(p * np.log(p)).sum(axis=1), rtol=1e-6)
    np.testing.assert_array_equal(columns["state"], occupancy.state)
    words = columns["rgb"].view(np.uint32)
    seen = np.stack([words >> 16 & 255, words >> 8 & 255, words & 255], axis=1)
    np.testing.assert_array_equal(seen[observed], CLASSES.palette[p.argmax(axis=1)[observed]])


def octomap_of_room(**settings: Any) -> SemanticOctoMap:
    made = SemanticOctoMap(ROOM.classes, 0.1, **settings)
    for k in range(2):
        made.update(ROOM.scan(k).observed)
    return made


@pytest.mark.parametrize("name", ["map.mcap", "map.bag"])
def test_a_map_comes_back_and_its_octomap_opens_in_octomap(name: str, tmp_path: Path) -> None:
    octomap = pytest.importorskip("octomap", reason="octomap-python is not installed")
    semantic_map = octomap_of_room(origin=(0.5, 0.0, 0.0))
    prediction = write_map(tmp_path / name, semantic_map)
    (back,) = open_log(tmp_path / name, topic="/semantic_map")
    np.testing.assert_allclose(back.points, semantic_map.positions, atol=1e-6)
    assert back.classes.names == ROOM.classes.names
    np.testing.assert_array_equal(back.hard_labels, prediction.label)
    np.testing.assert_allclose(back.class_weights, prediction.probability, atol=1e-7)

    message = octomap_message(tmp_path / name)
    assert (message.binary, message.id, message.resolution) == (True, "OcTree", 0.1)
    assert message.header.frame_id == "map_octomap"
    # What binaryMsgToMap does: an OcTree of the resolution reads the data as they are (readBinaryData), which in
    # octomap-python goes through a file, whose header has to say how many nodes follow.
    tree = octomap.OcTree(0.1)
    semantic_map.write(tmp_path / "map.bt")
    header, _, body = (tmp_path / "map.bt").read_bytes().partition(b"\ndata\n")
    assert message.data.tobytes() == body
    assert tree.readBinary(header + b"\ndata\n" + message.data.tobytes())
    centres = semantic_map.occupied(pruned=False).centres - semantic_map.origin
    for centre in centres[:: max(1, len(centres) // 50)]:
        assert tree.isNodeOccupied(tree.search(centre))


def octomap_message(path: Path) -> Any:
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        (connection,) = [c for c in reader.connections if c.topic == "/octomap"]
        assert connection.msgtype == "octomap_msgs/msg/Octomap"
        if path.suffix == ".bag":
            assert connection.digest == "9a45536b45c5e409cd49f04bb2d9999f"  # of the package octomap_msgs
        ((_, _, raw),) = reader.messages([connection])
        return reader.deserialize(raw, connection.msgtype)


def test_nothing_half_written(tmp_path: Path) -> None:
    clouds = soft_clouds()
    for name in ("run.mcap", "run.bag", "run"):
        with pytest.raises(InputError, match="not after the last"):
            write_clouds(tmp_path / name, [clouds[1], clouds[0]])
        assert list(tmp_path.iterdir()) == []
    renamed = replace(clouds[1], classes=Classes(("a", "b", "c")))
    with pytest.raises(InputError, match="same classes"):
        write_clouds(tmp_path / "run.mcap", [clouds[0], renamed])
    with pytest.raises(InputError, match="must differ"):
        write_clouds(tmp_path / "run.mcap", clouds, frame="sensor")
    (tmp_path / "there").mkdir()
    with pytest.raises(InputError, match="exists already"):
        write_clouds(tmp_path / "there", clouds)
    with pytest.raises(InputError, match="does not exist"):
        write_clouds(tmp_path / "nowhere" / "run.mcap", clouds)
    (tmp_path / "run.mcap").write_bytes(b"old")
    write_clouds(tmp_path / "run.mcap", clouds)
    assert len(open_log(tmp_path / "run.mcap")) == 3


def test_an_empty_map_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no points"):
        write_map(tmp_path / "map.mcap", SemanticOctoMap(CLASSES, 0.1))
    assert not list(tmp_path.iterdir())


def test_what_float32_holds_comes_back_bit_for_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    clouds = []
    for k in range(3):
        seen = np.round(1024 * rng.uniform(-20, 20, (200, 3))) / 1024
        T = pose(4.0 * k, -2.0, 1.5)
        clouds.append(
            LabelledCloud(seen + T[:3, 3], CLASSES, rng.integers(-1, 3, 200, np.int32), T_world_sensor=T)
        )
    write_clouds(tmp_path / "run.mcap", clouds)
    maps = []
    for source in (clouds, open_log(tmp_path / "run.mcap")):
        semantic_map = SemanticOctoMap(CLASSES, 0.25)
        for cloud in source:
            semantic_map.update(cloud)
        maps.append(semantic_map)
    (_, before), (_, after) = (semantic_map.to_arrays() for semantic_map in maps)
    for name, array in before.items():
        np.testing.assert_array_equal(array, after[name])


def test_a_real_drive_comes_back(data_dir: Path, tmp_path: Path) -> None:
    scans = open_scans(data_dir / "semantickitti_08", labels="predictions")[:2]
    write_clouds(tmp_path / "drive.mcap", scans)
    for scan, back in zip(scans, open_scans(tmp_path / "drive.mcap", features=("intensity",))):
        np.testing.assert_allclose(back.points, scan.points, rtol=0, atol=4e-6)  # half a float32 step at 80 m
        np.testing.assert_array_equal(back.labels, scan.hard_labels)
        np.testing.assert_array_equal(back.features, scan.features)
        assert back.classes.names == scan.classes.names
