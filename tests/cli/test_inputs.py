"""The options that say which scans are read, and in which classes."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semgp.class_files import ClassFile, write_class_file
from semgp.classes import MISSING, Classes
from semgp.cli import main
from semgp.cli.inputs import Inputs, at_most, dropped_labels, sources
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.readers import READERS, Scans, open_scans
from semgp.readers.protocol import options_of
from semgp.writers import write_npz
from tests.reader_samples import write_kitti_sequence, write_nyu_folder, write_pcd, write_point_folder

ROAD = Classes(("road", "car"))


def run(*arguments: object) -> int:
    try:
        main([str(a) for a in arguments])
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def npz(path: Path, classes: Classes, labels: list[int], weights: bool = False) -> Path:
    cloud = LabelledCloud(np.arange(3.0 * len(labels)).reshape(-1, 3), classes, np.array(labels, np.int32))
    write_npz(path, replace(cloud, labels=None, weights=cloud.class_weights) if weights else cloud)
    return path


# ---------------------------------------------------------------- which scans


def test_paths_are_read_one_after_the_other(tmp_path: Path) -> None:
    kitti, one = (
        write_kitti_sequence(tmp_path),
        write_kitti_sequence(tmp_path / "other") / "velodyne" / "000001.bin",
    )
    clouds = sources([kitti, one])
    assert [len(cloud) for cloud in clouds] == [50, 51, 53, 51]
    assert [len(cloud) for cloud in clouds[2:]] == [53, 51]
    np.testing.assert_array_equal(clouds[-1].points, open_scans(one)[0].points)


def test_nothing_is_read_before_it_is_asked_for_and_nothing_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: Counter[int] = Counter()

    def scan(k: int) -> LabelledCloud:
        read[k] += 1
        return LabelledCloud(np.zeros((1, 3)), ROAD, np.zeros(1, np.int32))

    monkeypatch.setattr("semgp.readers.open_scans", lambda path: Scans(range(5), scan))
    clouds = sources([tmp_path])
    assert not read
    list(clouds)
    assert read == dict.fromkeys(range(5), 1)
    _ = clouds[3]
    assert read[3] == 2


@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        (Inputs(), [0, 1, 2, 3, 4, 5]),
        (Inputs(every=2), [0, 2, 4]),
        (Inputs(first=1, every=2), [1, 3, 5]),
        (Inputs(first=1, last=3), [1, 2, 3]),
        (Inputs(last=99, every=5), [0, 5]),
    ],
)
def test_some_scans(inputs: Inputs, expected: list[int], tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    a, b = write_point_folder(tmp_path), write_point_folder(tmp_path / "b")
    sizes = [9, 10, 11, 9, 10, 11]
    assert [len(cloud) for cloud in sources([a, b], inputs)] == [sizes[k] for k in expected]


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        (Inputs(every=0), "--every is at least 1"),
        (Inputs(first=-1), "--first at least 0"),
        (Inputs(first=2, last=1), "--last not below --first"),
        (Inputs(first=3), "there is no scan 3: there are 3"),
    ],
)
def test_scans_that_are_not_there(inputs: Inputs, message: str, tmp_path: Path) -> None:
    path = write_point_folder(tmp_path)
    with pytest.raises(InputError, match=message):
        sources([path], inputs)
    with pytest.raises(InputError, match="give at least one scan"):
        sources([], inputs)


@pytest.mark.parametrize("n", [1, 2, 19, 20, 21, 59, 100, 1000])
def test_learning_takes_a_bounded_stretch_of_the_middle(n: int) -> None:
    taken = at_most(Scans(range(n), lambda k: LabelledCloud(np.zeros((1, 3)), ROAD)), 20, 5).indices
    assert len(taken) == min(n, 20)
    steps = set(np.diff(taken).tolist())
    assert len(steps) <= 1
    assert steps <= {1, 2, 3, 4, 5}
    assert abs((taken[0] + taken[-1]) / 2 - (n - 1) / 2) <= 3


# ---------------------------------------------------------------- options of formats


def test_options_that_a_format_does_not_have(tmp_path: Path) -> None:
    path = npz(tmp_path / "a.npz", ROAD, [0])
    with pytest.raises(InputError, match=r"npz has no option 'labels'; the formats that have it: .*semantickitti"):
        sources([path], Inputs(labels="predictions"))
    with pytest.raises(InputError, match=r"semantickitti has no option 'field'; the formats that have it: .*ply"):
        sources([write_kitti_sequence(tmp_path)], Inputs(field="label"))


def test_every_reader_option_of_inputs_is_some_readers() -> None:
    taken = {option for reader in READERS for option in options_of(reader)}
    own = {"remap", "network", "first", "last", "every"}
    assert set(Inputs.__dataclass_fields__) - own <= taken


def test_labels_and_poses_go_to_the_readers(tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    predicted = sources([path], Inputs(labels="predictions"))[1]
    np.testing.assert_array_equal(predicted.labels, open_scans(path, labels="predictions")[1].labels)
    (tmp_path / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 5\n" * 4)
    origin = sources([path], Inputs(poses=tmp_path / "poses.txt"))[1].origin
    np.testing.assert_allclose(np.array(origin), [5, 0, 0], atol=1e-12)


def test_the_class_list_of_nyu(tmp_path: Path) -> None:
    path = write_nyu_folder(tmp_path)
    for name, count in (("nyu13", 13), ("nyu40", 40), ("13", 13)):
        cloud = sources([path], Inputs(classes=name))[0]
        assert len(cloud.classes) == count
        assert cloud.classes.names[0] in ("bed", "wall")
    write_class_file(tmp_path / "mine.toml", Classes(tuple(f"thing {c}" for c in range(13))))
    for other in ("scannet", str(tmp_path / "mine.toml")):
        with pytest.raises(InputError, match=r"nyu13.*nyu40"):
            sources([path], Inputs(classes=other))


# ---------------------------------------------------------------- classes


def test_classes_that_are_numbered_agree_on_the_most(tmp_path: Path) -> None:
    paths = [npz(tmp_path / f"{k}.npz", Classes.numbered(k), [k - 1, MISSING]) for k in (2, 5, 3)]
    clouds = sources(paths)
    assert [clouds[k].classes for k in (2, 1, 0)] == [Classes.numbered(5)] * 3
    assert [cloud.hard_labels.tolist() for cloud in clouds] == [[1, MISSING], [4, MISSING], [2, MISSING]]
    assert sources(paths, Inputs(classes="7"))[0].classes == Classes.numbered(7)
    with pytest.raises(InputError, match="labels"):
        sources(paths, Inputs(classes="3"))[1]


def test_a_bare_scan_takes_the_classes_of_the_others(tmp_path: Path) -> None:
    write_npz(tmp_path / "bare.npz", LabelledCloud(np.zeros((2, 3)), Classes.numbered(1)))
    clouds = sources([tmp_path / "bare.npz", npz(tmp_path / "a.npz", ROAD, [0])])
    assert [cloud.classes for cloud in clouds] == [ROAD, ROAD]


def test_soft_labels_that_are_numbered_are_widened(tmp_path: Path) -> None:
    paths = [npz(tmp_path / "a.npz", ROAD, [0]), npz(tmp_path / "b.npz", Classes.numbered(1), [0], weights=True)]
    assert sources(paths)[1].weights is not None
    np.testing.assert_array_equal(np.array(sources(paths)[1].weights), [[1, 0]])


def test_classes_go_by_their_names(tmp_path: Path) -> None:
    paths = [
        npz(tmp_path / "a.npz", ROAD, [0, 1]),
        npz(tmp_path / "b.npz", Classes(("car", "road")), [0, 1, MISSING]),
    ]
    assert sources(paths)[1].hard_labels.tolist() == [1, 0, MISSING]
    paths.append(npz(tmp_path / "c.npz", Classes(("road", "tree")), [0]))
    with pytest.raises(InputError, match=r"classes of scan 2 \(road, tree\) .* --remap"):
        list(sources(paths))


def test_remapping_brings_sources_together(tmp_path: Path) -> None:
    paths = [
        npz(tmp_path / "a.npz", ROAD, [0, 1, 1]),
        npz(tmp_path / "b.npz", Classes(("street", "vehicle", "sky")), [0, 1, 2, 2]),
    ]
    mapping = ClassFile(Classes(("thing", "ground")), (("car", "vehicle"), ("road", "street")))
    write_class_file(tmp_path / "mine.toml", mapping)
    clouds = sources(paths, Inputs(remap=str(tmp_path / "mine.toml")))
    for _ in range(2):  # counted once, however often they are read
        assert [cloud.hard_labels.tolist() for cloud in clouds] == [[1, 0, 0], [1, 0, MISSING, MISSING]]
        assert dropped_labels(clouds) == {"sky": 2}


def test_raw_ids_of_point_files(tmp_path: Path) -> None:
    points = np.zeros((4, 3))
    cloud = LabelledCloud(points, Classes.numbered(100), np.array([40, 10, 99, 40], np.int32))
    path = write_pcd(tmp_path / "a.pcd", cloud, "ascii")
    found = sources([path], Inputs(classes="semantickitti"))[0]
    assert [found.classes.names[c] if c >= 0 else None for c in found.hard_labels] == ["road", "car", None, "road"]


# ---------------------------------------------------------------- as a user types them


def test_commands_take_the_options(
    tmp_path: Path, corner: LabelledCloud, capsys: pytest.CaptureFixture[str]
) -> None:
    for k in range(3):
        write_npz(tmp_path / f"{k}.npz", replace(corner[k::3], classes=Classes.numbered(3)))
    (tmp_path / "mine.csv").write_text("name,ids\nup,2\ndown,0\n")
    scans = [tmp_path / f"{k}.npz" for k in range(3)]
    out = tmp_path / "map.semgp"
    options = ("--remap", tmp_path / "mine.csv", "--first", "1", "--no-learn", "--quiet")
    assert run("build", *scans, "--out", out, "--kind", "knn", *options) == 0
    capsys.readouterr()
    assert run("evaluate", out, "--truth", scans[0], "--remap", tmp_path / "mine.csv", "--json") == 0
    captured = capsys.readouterr()
    assert '"accuracy"' in captured.out
    assert f"has no class for: {(corner[::3].hard_labels == 1).sum()} of class 1" in captured.err
    assert run("learn", *scans, "--classes", "nothing", "--out", tmp_path / "m.json") == 2
    assert "there is no class list 'nothing'" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("command", ["build", "learn", "evaluate"])
def test_help_names_the_options(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(command, "--help") == 0
    text = capsys.readouterr().out
    assert all(f"--{name.replace('_', '-')}" in text for name in Inputs.__dataclass_fields__)
