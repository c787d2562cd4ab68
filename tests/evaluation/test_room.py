"""The Stanford room and its OctoMaps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.evaluation.room import STANFORD, STANFORD_IDS, into_room, octomap_figure, stanford_room
from tests.evaluation.pictures import opened
from tests.reader_samples import write_pcd


def room_cloud(n: int = 300) -> LabelledCloud:
    rng = np.random.default_rng(2)
    return LabelledCloud(rng.uniform(0, 2, (n, 3)), STANFORD, labels=rng.integers(0, len(STANFORD), n, np.int32))


def write_pieces(folder: Path, ids: tuple[int, ...]) -> None:
    cloud = room_cloud()
    labels = np.array(ids, dtype=np.int32)[np.arange(len(cloud)) % len(ids)]
    wide = replace(cloud, classes=type(STANFORD).numbered(99), labels=labels)
    for k, part in enumerate((slice(0, 100), slice(100, 300))):
        write_pcd(folder / f"{k + 1}.pcd", wide[part], "ascii")


def test_room_is_read_from_its_pieces(tmp_path: Path) -> None:
    write_pieces(tmp_path, STANFORD_IDS)
    room = stanford_room(tmp_path)
    assert room.classes == STANFORD
    assert np.allclose(room.points, room_cloud().points, atol=1e-6)
    assert np.array_equal(room.hard_labels, np.arange(300) % len(STANFORD_IDS))


@pytest.mark.parametrize("unknown", [0, 4, 8, 10, 98])
def test_room_with_unknown_labels(tmp_path: Path, unknown: int) -> None:
    write_pieces(tmp_path, (1, 2, unknown))
    with pytest.raises(FileFormatError, match="no class of the room"):
        stanford_room(tmp_path)


def test_room_without_pieces(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no pieces"):
        stanford_room(tmp_path)


def test_octomap_figure_has_a_column_for_each_resolution() -> None:
    cloud = room_cloud()
    view = into_room(cloud.points, width=90)
    plain = opened(octomap_figure("room", "", cloud, view, (0.5, 1.0)))
    assert plain.shape[1] >= 3 * 90
    coloured = replace(cloud, colours=np.full((300, 3), (10, 200, 10), dtype=np.uint8))
    both = opened(octomap_figure("room", "", coloured, view, (0.5, 1.0)))
    assert len(both) > len(plain) + 60
    pure_green = (both[..., 1] > 2 * both[..., 0] + 60) & (both[..., 1] > 2 * both[..., 2] + 60)
    assert pure_green[len(plain) - 60 :].sum() > 1000
    with pytest.raises(InputError, match="at least one resolution"):
        octomap_figure("room", "", cloud, view, ())
    with pytest.raises(InputError, match="with labels"):
        octomap_figure("room", "", replace(cloud, labels=None), view)


def test_view_into_the_room_holds_it_all() -> None:
    points = np.random.default_rng(0).uniform((14, 1, 0), (20, 6, 2.7), (2000, 3))
    view = into_room(points)
    x, y, z = view.to_camera(points).T
    assert (z > 0).all()
    assert (np.abs(view.focal * x / z) < view.width / 2).mean() > 0.98
    assert (np.abs(view.focal * y / z) < view.height / 2).mean() > 0.98
    assert view.T_world_camera[1, 3] > 6
    assert view.T_world_camera[2, 3] > 2.7
