"""Commands on robot logs: topics, build from a bag, export to a bag, and the node's errors."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from semgp.cli import main
from semgp.logs.recording import write_clouds
from semgp.readers import open_scans, read
from semgp.scene import DepthCamera, synthetic_room
from tests.log_samples import raw_bag
from tests.test_logs import write_drive
from tests.test_logs_images import ROOM, write_frames


def run(*arguments: object) -> int:
    try:
        main([str(a) for a in arguments])
    except SystemExit as end:
        return int(end.code or 0)
    return 0


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    with raw_bag(tmp_path / "run.mcap") as bag:
        write_drive(bag)
        bag.cloud("lidar", 5.0, np.zeros(1, dtype=[(c, "<f4") for c in ("x", "y", "z", "label")]))
    return tmp_path / "run.mcap"


def test_topics(drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("topics", drive) == 0
    shown = capsys.readouterr().out
    assert all(text in shown for text in ("/points", "sensor_msgs/msg/PointCloud2", "base, lidar, map, odom"))
    assert run("--json", "topics", drive) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["frames"] == ["base", "lidar", "map", "odom"]
    assert {"topic": "/points", "type": "sensor_msgs/msg/PointCloud2", "messages": 5} in facts["topics"]
    assert run("topics", drive.parent) == 2
    assert "no robot log" in capsys.readouterr().err


def test_build_from_a_bag_says_what_it_skips(drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = drive.with_name("map.semgp")
    options = ("--topic", "/points", "--classes", 13, "--model", "general", "--resolution", 0.3, "--no-learn")
    assert run("build", drive, "--out", out, *options) == 0
    said = capsys.readouterr()
    assert "from 4 scans" in said.out
    assert "1 scans skipped, the first because" in said.err.replace("\n", " ")
    assert run("build", drive, "--out", out, "--topic", "/lidar") == 2
    assert "has no topic /lidar; its topics are" in capsys.readouterr().err.replace("\n", " ")


def test_build_from_images(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with raw_bag(tmp_path / "run.bag") as bag:
        write_frames(bag)
    topics = ("--depth", "/depth", "--labels", "/labels", "--camera-info", "/camera_info", "--colour", "/colour")
    out = tmp_path / "map.semgp"
    options = ("--model", "general", "--resolution", 0.2, "--no-learn", "--classes", len(ROOM.classes))
    assert run("build", tmp_path / "run.bag", "--out", out, *topics, *options) == 0
    assert "from 2 scans" in capsys.readouterr().out


def test_from_bag_to_map_to_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    room = synthetic_room(views=24, camera=DepthCamera(width=40, height=30))
    write_clouds(tmp_path / "run", [room.scan(k).observed for k in range(2)])
    built, out = tmp_path / "map.semgp", tmp_path / "map.mcap"
    options = ("--model", "general", "--resolution", 0.3, "--no-learn", "--free-space")
    assert run("build", tmp_path / "run", "--out", built, *options) == 0
    assert run("export", built, "--out", out) == 0
    assert "points, 0.3 m apart, and an OctoMap" in capsys.readouterr().out
    (back,) = open_scans(out, topic="/semantic_map")
    assert back.classes.names == room.classes.names
    assert back.labelled.any()
    assert run("topics", out) == 0
    assert "octomap_msgs/msg/Octomap" in capsys.readouterr().out
    assert run("query", built, "--points", out, "--out", tmp_path / "again.npz") == 0
    assert len(read(tmp_path / "again.npz")) == len(back)


def test_ros2_without_ros(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    assert run("ros2") == 2
    assert "which pip cannot install" in capsys.readouterr().err.replace("\n", " ")
    assert run("ros2", "--octomap") == 2
    assert "the GP map is no octree" in capsys.readouterr().err
    assert run("ros2", "--rate", "0") == 2
    assert run("ros2", "--model", "paper") == 2
    assert "--model must be one of" in capsys.readouterr().err
