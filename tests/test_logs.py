"""Bags of a robot that moves: clouds by tf and odometry, what is skipped, and what goes wrong."""

import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.logs.bag import Bag
from semgp.logs.reader import open_log
from semgp.readers import open_scans
from semgp.scene import DepthCamera, synthetic_room
from tests.log_samples import STORAGES, RawBag, pose, raw_bag, rows_of

ROOM = synthetic_room(views=24, camera=DepthCamera(width=40, height=30))
BASE_SENSOR = pose(0.2, -0.1, 0.5, yaw=0.3, pitch=0.2)
MAP_ODOM = pose(1.0, 2.0, 0.0, yaw=1.0)
BEGIN = 1_700_000_000.0


def odom_base(t: float) -> NDArray[np.float64]:
    """Where the robot is at a time after the beginning: it drives a curve."""
    return pose(2 * np.sin(0.5 * t), t, 0.1 * t, yaw=0.4 * t)


def seen_from(T: NDArray[np.float64], view: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return points in the frame of a sensor at T, and labels."""
    cloud = ROOM.scan(view).observed
    assert cloud.labels is not None
    return (cloud.points - T[:3, 3]) @ T[:3, :3], cloud.labels


def write_drive(bag: RawBag, *, tf_step: float = 0.25, n: int = 4) -> list[NDArray[np.float64]]:
    """Write tf (map, odom, base, lidar) and n clouds at stamps between its samples; return the true poses."""
    bag.tf("map", "odom", MAP_ODOM, BEGIN, "/tf_static")
    bag.tf("base", "lidar", BASE_SENSOR, BEGIN, "/tf_static")
    for t in np.arange(0, 3, tf_step):
        bag.tf("odom", "base", odom_base(t), BEGIN + t)
    truth = []
    for k in range(n):
        t = 0.3 + 0.5 * k
        T = MAP_ODOM @ interpolated(t, tf_step) @ BASE_SENSOR
        bag.cloud("lidar", BEGIN + t, rows_of(*seen_from(T, k)))
        truth.append(T)
    return truth


def interpolated(t: float, step: float) -> NDArray[np.float64]:
    """Return the robot's pose as tf2 has it: a straight line and slerp (scipy's) between two samples."""
    before, after = np.floor(t / step) * step, (np.floor(t / step) + 1) * step
    a, b = odom_base(before), odom_base(after)
    share = (t - before) / step
    T = np.eye(4)
    T[:3, 3] = (1 - share) * a[:3, 3] + share * b[:3, 3]
    T[:3, :3] = Slerp([0, 1], Rotation.from_matrix([a[:3, :3], b[:3, :3]]))(share).as_matrix()
    return T


@pytest.mark.parametrize("name", STORAGES)
def test_clouds_are_placed_by_a_chain_of_frames(name: str, tmp_path: Path) -> None:
    with raw_bag(tmp_path / name) as bag:
        truth = write_drive(bag)
    scans = open_scans(tmp_path / name, classes=ROOM.classes)
    assert len(scans) == len(truth)
    for k, (cloud, T) in enumerate(zip(scans, truth)):
        seen = ROOM.scan(k).observed
        np.testing.assert_allclose(pose_of(cloud), T, atol=1e-7)  # stamps are rounded to nanoseconds
        np.testing.assert_allclose(cloud.points, seen.points, atol=2e-6)
        np.testing.assert_array_equal(cloud.labels, seen.labels)
        assert cloud.classes == ROOM.classes
        assert cloud.stamp == pytest.approx(BEGIN + 0.3 + 0.5 * k, abs=1e-6)
    assert scans[2].stamp == scans[-2].stamp


def test_another_fixed_frame(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        truth = write_drive(bag)
    scan = open_log(tmp_path / "run.mcap", frame="odom")[1]
    np.testing.assert_allclose(pose_of(scan), np.linalg.inv(MAP_ODOM) @ truth[1], atol=1e-7)
    as_it_is = open_log(tmp_path / "run.mcap", frame="/lidar")[1]
    assert as_it_is.T_world_sensor is None
    np.testing.assert_allclose(as_it_is.points, seen_from(truth[1], 1)[0], atol=2e-6)


def test_clouds_of_one_moment_are_told_apart(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.bag") as bag:
        bag.tf("map", "lidar", np.eye(4), 1.0)
        for k in range(3):
            bag.cloud("lidar", 1.0, rows_of(np.full((2, 3), k), np.zeros(2)))
    assert [cloud.points[0, 0] for cloud in open_log(tmp_path / "run.bag")] == [0, 1, 2]


def test_scans_without_a_pose_are_skipped_and_counted(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        bag.cloud("lidar", BEGIN - 1, rows_of(np.zeros((1, 3)), np.zeros(1)))
        write_drive(bag)
        bag.cloud("lidar", BEGIN + 10, rows_of(np.zeros((1, 3)), np.zeros(1)))
    scans = open_log(tmp_path / "run.mcap")
    assert len(scans) == 4
    assert [round(stamp - BEGIN, 3) for stamp, _ in scans.skipped] == [-1.0, 10.0]
    assert "'base' in 'odom' is known from" in scans.skipped[0][1]


def test_a_gap_in_tf_is_not_bridged(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        write_drive(bag, tf_step=1.25)
    with pytest.raises(InputError, match=r"none of 4 scans can be used.*gap of 1.25 s.*max_gap = 1 s"):
        open_log(tmp_path / "run.mcap")
    scan = open_log(tmp_path / "run.mcap", max_gap=1.5)[0]
    np.testing.assert_allclose(pose_of(scan), MAP_ODOM @ interpolated(0.3, 1.25) @ BASE_SENSOR, atol=1e-7)


def test_a_chain_in_which_nothing_moves_is_no_pose(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        bag.tf("base", "lidar", BASE_SENSOR, 1.0, "/tf_static")
        for k in range(2):
            bag.cloud("lidar", 1.0 + k, rows_of(np.ones((2, 3)), np.zeros(2)))
    with pytest.raises(InputError, match="nothing in tf moves 'lidar': give frame='base' if it stood still"):
        open_log(tmp_path / "run.mcap")
    scans = open_log(tmp_path / "run.mcap", frame="base")
    np.testing.assert_allclose(pose_of(scans[1]), BASE_SENSOR, atol=1e-12)


def test_one_cloud_alone_is_its_own_world(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.db3") as bag:
        bag.cloud("velodyne", 5.0, rows_of(np.ones((2, 3)), np.array([0, -1])))
    (cloud,) = open_log(tmp_path / "run.db3")
    assert cloud.T_world_sensor is None
    np.testing.assert_array_equal(cloud.labels, [0, -1])


def test_frames_that_are_not_connected(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        write_drive(bag)
    with pytest.raises(InputError, match=r"no transform from 'lidar' to 'earth': tf knows base, lidar, map, odom"):
        open_log(tmp_path / "run.mcap", frame="earth")


def test_a_frame_with_two_parents_is_refused(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        write_drive(bag)
        bag.tf("vicon", "base", np.eye(4), BEGIN)
    with pytest.raises(InputError, match=r"tf is no tree: it has 'base' .*odom, vicon"):
        open_log(tmp_path / "run.mcap")


def pose_of(cloud: LabelledCloud) -> NDArray[np.float64]:
    assert cloud.T_world_sensor is not None
    return cloud.T_world_sensor


def sampled_covariance(Ts: list[NDArray[np.float64]], T: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance of poses about T: position, and small rotations along the world's axes."""
    turns = Rotation.from_matrix(np.array([S[:3, :3] @ T[:3, :3].T for S in Ts])).as_rotvec()
    moves = np.array([S[:3, 3] - T[:3, 3] for S in Ts])
    both = np.hstack([moves, turns])
    return np.asarray(both.T @ both / len(both))


def test_odometry_with_its_covariance_carried_to_the_sensor(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    A = rng.normal(scale=1e-3, size=(6, 6))
    S = A @ A.T
    with raw_bag(tmp_path / "run.mcap") as bag:
        bag.tf("map", "odom", MAP_ODOM, BEGIN, "/tf_static")
        bag.tf("base", "lidar", BASE_SENSOR, BEGIN, "/tf_static")
        for t in (0.0, 0.5):
            bag.odometry(("odom", "base"), odom_base(t), S, BEGIN + t)
        bag.cloud("lidar", BEGIN + 0.2, rows_of(np.ones((3, 3)), np.zeros(3)))
    scan = open_log(tmp_path / "run.mcap", odometry="/odom", frame="map")[0]
    body = interpolated(0.2, 0.5)
    T = MAP_ODOM @ body @ BASE_SENSOR
    np.testing.assert_allclose(pose_of(scan), T, atol=1e-7)
    shaken = []
    for d in rng.multivariate_normal(np.zeros(6), S, 20000):
        moved = body.copy()
        moved[:3, :3] = Rotation.from_rotvec(d[3:]).as_matrix() @ body[:3, :3]
        moved[:3, 3] += d[:3]
        shaken.append(MAP_ODOM @ moved @ BASE_SENSOR)
    sampled = sampled_covariance(shaken, T)
    assert scan.pose_covariance is not None
    np.testing.assert_allclose(scan.pose_covariance, sampled, atol=0.05 * np.abs(sampled).max())
    assert open_log(tmp_path / "run.mcap", odometry="/odom", covariance=False)[0].pose_covariance is None
    in_odom = open_log(tmp_path / "run.mcap", odometry="/odom")[0]
    np.testing.assert_allclose(pose_of(in_odom), body @ BASE_SENSOR, atol=1e-7)


def test_poses_that_do_not_say_what_they_are_of(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.bag") as bag:
        for t in (0.0, 1.0):
            bag.pose_stamped("odom", odom_base(t), BEGIN + t)
        bag.cloud("/lidar", BEGIN, rows_of(np.ones((3, 3)), np.zeros(3)))
    with pytest.raises(InputError, match="give it as pose_frame"):
        open_log(tmp_path / "run.bag", odometry="/pose")
    scan = open_log(tmp_path / "run.bag", odometry="/pose", pose_frame="lidar")[0]
    np.testing.assert_allclose(pose_of(scan), odom_base(0), atol=1e-12)
    assert scan.pose_covariance is None


def test_covariances_between_two_poses(tmp_path: Path) -> None:
    S = np.diag([1.0, 2, 3, 4, 5, 6]) * 1e-4
    with raw_bag(tmp_path / "run.mcap") as bag:
        bag.pose_with_covariance("map", np.eye(4), S, BEGIN)
        bag.pose_with_covariance("map", np.eye(4), 3 * S, BEGIN + 1)
        bag.cloud("lidar", BEGIN + 0.25, rows_of(np.ones((3, 3)), np.zeros(3)))
    scan = open_log(tmp_path / "run.mcap", odometry="/pose", pose_frame="lidar")[0]
    assert scan.pose_covariance is not None
    np.testing.assert_allclose(scan.pose_covariance, 1.5 * S, rtol=1e-6, atol=1e-12)


def test_a_covariance_that_is_none_is_refused(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        bag.odometry(("odom", "lidar"), np.eye(4), np.diag([1.0, -1, 1, 1, 1, 1]), BEGIN)
        bag.cloud("lidar", BEGIN, rows_of(np.ones((3, 3)), np.zeros(3)))
    with pytest.raises(FileFormatError, match="pose_covariance must be symmetric without negative eigenvalues"):
        open_log(tmp_path / "run.mcap", odometry="/odom")[0]
    assert open_log(tmp_path / "run.mcap", odometry="/odom", covariance=False)[0].labelled.all()


def test_unknown_covariances_are_none(tmp_path: Path) -> None:
    unknown = np.diag([-1.0, 0, 0, 0, 0, 0])
    with raw_bag(tmp_path / "run.mcap") as bag:
        bag.odometry(("odom", "lidar"), odom_base(0), np.zeros((6, 6)), BEGIN)
        bag.odometry(("odom", "lidar"), odom_base(1), unknown, BEGIN + 1)
        for t in (0, 1):
            bag.cloud("lidar", BEGIN + t, rows_of(np.ones((3, 3)), np.zeros(3)))
    scans = open_log(tmp_path / "run.mcap", odometry="/odom")
    assert [scan.pose_covariance for scan in scans] == [None, None]


def test_no_such_topic_lists_those_there_are(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        write_drive(bag)
    for options in ({"topic": "/nothing"}, {"odometry": "/nothing"}, {"depth": "/depth"}):
        with pytest.raises(
            InputError, match=r"/points  sensor_msgs/msg/PointCloud2  4\n  /tf  tf2_msgs/msg/TFMessage"
        ):
            open_log(tmp_path / "run.mcap", **options)  # type: ignore[arg-type]
    with pytest.raises(
        InputError, match="topic /tf holds tf2_msgs/msg/TFMessage, not sensor_msgs/msg/PointCloud2"
    ):
        open_log(tmp_path / "run.mcap", topic="/tf")


def test_several_topics_of_clouds_need_a_choice(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        write_drive(bag)
        bag.cloud("lidar", BEGIN + 1, rows_of(np.ones((1, 3)), np.zeros(1)), "/rear")
    with pytest.raises(InputError, match="several topics of sensor_msgs/msg/PointCloud2: choose one by topic="):
        open_log(tmp_path / "run.mcap")
    assert len(open_log(tmp_path / "run.mcap", topic="/rear")) == 1


def test_no_labels_says_which_fields_there_are_and_how_to_get_labels(tmp_path: Path) -> None:
    rows = np.ones(3, dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("ring", "<u2")])
    with raw_bag(tmp_path / "run.mcap") as bag:
        bag.cloud("lidar", 1.0, rows)
    with pytest.raises(
        FileFormatError, match=r"/points at 1.000 s: .*only the fields x, y, z, ring: name the field"
    ):
        open_log(tmp_path / "run.mcap")[0]
    with pytest.raises(FileFormatError, match="no field 'kind'; its fields are x, y, z, ring"):
        open_log(tmp_path / "run.mcap", field="kind")[0]
    np.testing.assert_array_equal(open_log(tmp_path / "run.mcap", field="ring")[0].labels, [1, 1, 1])
    assert not open_log(tmp_path / "run.mcap", labelled=False)[0].labelled.any()


def test_probabilities_in_one_field(tmp_path: Path) -> None:
    p = np.array([[0.5, 0.25, 0.25], [0, 0, 1]])
    rows = np.zeros(2, dtype=[("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("probabilities", "<f4", 3)])
    rows["probabilities"] = p
    with raw_bag(tmp_path / "run.bag") as bag:
        bag.cloud("lidar", 1.0, rows)
    cloud = open_log(tmp_path / "run.bag", classes=Classes(("a", "b", "c")))[0]
    np.testing.assert_array_equal(cloud.weights, p)


@pytest.mark.parametrize("name", ["run.mcap", "run.db3", "run.bag"])
def test_damaged_bags(name: str, tmp_path: Path) -> None:
    with raw_bag(tmp_path / name) as bag:
        write_drive(bag)
    whole = (tmp_path / name).read_bytes()
    for length in (0, 5, 100, len(whole) // 2, len(whole) - 9):
        (tmp_path / name).write_bytes(whole[:length])
        with pytest.raises(FileFormatError, match="damaged, truncated or no bag") as caught:
            list(open_log(tmp_path / name))
        assert str(tmp_path / name) in str(caught.value)


def test_without_rosbags(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from semgp.logs.definitions import typestore

    (tmp_path / "run.mcap").write_bytes(b"")
    typestore.cache_clear()
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'semgp\[ros\]'"):
        open_scans(tmp_path / "run.mcap")


def test_topics_of_a_bag(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        write_drive(bag)
    found = Bag(tmp_path / "run.mcap")
    assert {topic.name: topic.count for topic in found.topics.values()} == {
        "/points": 4,
        "/tf": 12,
        "/tf_static": 2,
    }
    assert (found.end - found.begin) / 1e9 == pytest.approx(2.75, abs=1e-6)
