"""Which way is up: from the cameras of a recording to clouds, maps, files and stores."""

from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from semgp.blocks.model import BlockModel
from semgp.camera import NYU_CAMERA, cloud_from_depth
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.maps.files import load_map, save_map
from semgp.maps.fusion import fuse
from semgp.maps.gp import GPSemanticMap
from semgp.octomap import SemanticOctoMap
from semgp.planning import occupancy_grid
from semgp.planning.section import section
from semgp.readers import read
from semgp.store import MapStore, Settings, StoredMap, fuse_stored, save
from semgp.surfaces import surface, write_glb
from semgp.upward import Up, direction, level, up_of_cameras, vertical
from semgp.writers import write_npz
from tests.cli.test_commands import run
from tests.rgbd_samples import pose, write_seven_scenes

AXES: tuple[Up, ...] = get_args(Up)
OPTICAL_UPRIGHT = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
"""Columns are the axes of an optical frame that looks along x, in a world whose z points up."""


def poses(world: np.ndarray, tilts: list[float]) -> list[np.ndarray]:
    """Return cameras that look around, each tilted by some degrees; `world` turns the world below them."""
    found = []
    for i, tilt in enumerate(tilts):
        T = np.eye(4)
        T[:3, :3] = (
            world
            @ Rotation.from_euler("z", 70 * i, degrees=True).as_matrix()
            @ OPTICAL_UPRIGHT
            @ Rotation.from_euler("x", tilt, degrees=True).as_matrix()
        )
        found.append(T)
    return found


@given(st.sampled_from(AXES), st.lists(st.floats(-40, 40), min_size=1, max_size=9))
def test_cameras_that_tilt_are_held_upright_on_average(up: Up, tilts: list[float]) -> None:
    world, _ = Rotation.align_vectors([direction(up)], [[0, 0, 1]])
    assert up_of_cameras(poses(world.as_matrix(), tilts)) == up


@pytest.mark.parametrize("up", AXES)
def test_names_are_directions(up: Up) -> None:
    assert np.abs(direction(up)).sum() == 1
    assert direction(up)[vertical(up)] == (-1 if up[0] == "-" else 1)


@pytest.mark.parametrize("up", AXES)
def test_a_level_frame_is_the_world_turned(up: Up) -> None:
    R = level(up)
    np.testing.assert_array_equal(R @ direction(up), [0, 0, 1])
    np.testing.assert_array_equal(R @ R.T, np.eye(3))
    assert np.linalg.det(R) == 1


def test_a_level_frame_of_a_camera_is_a_body() -> None:
    np.testing.assert_array_equal(level("z"), np.eye(3))
    np.testing.assert_array_equal(level("-y").T @ [1, 0, 0], [0, 0, 1])  # x: forward
    np.testing.assert_array_equal(level("-y").T @ [0, 1, 0], [-1, 0, 0])  # y: left


@pytest.mark.parametrize("up", AXES)
def test_slices_grids_and_meshes_are_level_in_any_world(up: Up, corner: LabelledCloud, tmp_path: Path) -> None:
    def mapped(R: np.ndarray) -> SemanticOctoMap:
        T = np.eye(4)
        assert corner.T_world_sensor is not None
        T[:3, :3], T[:3, 3] = R, R @ corner.T_world_sensor[:3, 3]
        made = SemanticOctoMap(corner.classes, resolution=0.25)
        made.update(replace(corner, points=(corner.points + 0.0625) @ R.T, T_world_sensor=T))
        return made

    plain, turned = mapped(np.eye(3)), mapped(level(up).T)
    turned.up = up
    box = ((-0.25, -0.25), (2.25, 2.25))
    cuts = [section(m, 0.8625, *box, resolution=0.25) for m in (plain, turned)]
    np.testing.assert_array_equal(cuts[1].label, cuts[0].label)
    assert (cuts[0].label >= 0).any()
    grids = [occupancy_grid(m, *box, heights=(0.25, 1.0), resolution=0.25) for m in (plain, turned)]
    np.testing.assert_array_equal(grids[1].data, grids[0].data)
    assert (grids[0].data > 50).any()
    bounds = []
    for m in (plain, turned):
        write_glb(tmp_path / "a.glb", surface(m, resolution=0.25))
        bounds.append(trimesh.load(tmp_path / "a.glb").bounds)
    np.testing.assert_allclose(bounds[1], bounds[0], atol=0.3)


@pytest.mark.parametrize("up", ["", "w", "+z", "zz", "--z", "Z"])
def test_what_names_no_axis_is_refused(up: Up, corner: LabelledCloud) -> None:
    with pytest.raises(InputError, match="up is one of x, y, z, -x, -y, -z, not"):
        LabelledCloud(corner.points, corner.classes, up=up)
    with pytest.raises(InputError, match="up is one of"):
        Settings(corner.classes, BlockModel(), up=up)


def test_a_camera_that_is_the_world_has_y_downwards() -> None:
    depth, classes = np.ones((3, 4)), Classes(("floor",))
    assert cloud_from_depth(depth, NYU_CAMERA, classes).up == "-y"
    assert cloud_from_depth(depth, NYU_CAMERA, classes, T_world_sensor=np.eye(4)).up == "z"
    assert cloud_from_depth(depth, NYU_CAMERA, classes, up="x")[:2].up == "x"


def test_commands_take_what_the_scans_say_unless_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_seven_scenes(tmp_path / "recording")
    said = up_of_cameras([pose(i) for i in range(4)])
    assert said == "-y"
    for options, up in (((), said), (("--up", "x"), "x"), (("--up=-z",), "-z")):
        for out in (tmp_path / f"{up}.semgp", tmp_path / f"store {up}"):
            assert run("build", folder, "--no-learn", "--out", out, *options) == 0
            assert load_map(out).up == up
    assert run("view", tmp_path / "-y.semgp", "--html", tmp_path / "page.html") == 0
    assert '"up": [0.0, -1.0, 0.0]' in (tmp_path / "page.html").read_text()
    assert run("build", folder, "--up", "w", "--out", tmp_path / "no.semgp") == 2
    assert "--up" in capsys.readouterr().err


def test_point_files_keep_it(corner: LabelledCloud, tmp_path: Path) -> None:
    cloud = LabelledCloud(corner.points, corner.classes, up="-y")
    write_npz(tmp_path / "a.npz", cloud)
    assert read(tmp_path / "a.npz").up == "-y"
    for wrong in ("up", ["z", "y"]):
        np.savez(tmp_path / "b.npz", points=cloud.points, up=np.array(wrong))
        with pytest.raises(FileFormatError, match="up"):
            read(tmp_path / "b.npz")


def test_maps_keep_it_through_files_and_stores(corner: LabelledCloud, tmp_path: Path) -> None:
    whole = GPSemanticMap(corner.classes, BlockModel(resolution=0.05))
    assert whole.up == "z"
    whole.up = "-y"
    whole.update(corner)
    save_map(whole, tmp_path / "map.semgp")
    save(whole, tmp_path / "store")
    for again in (load_map(tmp_path / "map.semgp"), load_map(tmp_path / "store")):
        assert isinstance(again, GPSemanticMap | StoredMap)
        assert again.up == "-y"
        assert again.crop((0, 0, -1), (1, 3, 3)).up == "-y"
    stored = StoredMap(tmp_path / "store")
    assert stored.load().up == "-y"
    assert fuse(whole, whole).up == "-y"
    fuse_stored(stored, stored, tmp_path / "both")
    assert MapStore(tmp_path / "both").manifest().settings.up == "-y"


def test_maps_that_do_not_say_have_z(corner: LabelledCloud) -> None:
    plain = Settings(corner.classes, BlockModel(), up="y").to_json()
    assert Settings.from_json(plain).up == "y"
    del plain["up"]
    assert Settings.from_json(plain).up == "z"
