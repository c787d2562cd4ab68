"""The layouts of RGB-D folders: 7-Scenes, exports of ScanNet, Open3D's, and TUM's (see `rgbd_tum`)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from semgp.camera import Pinhole
from semgp.errors import FileFormatError
from semgp.readers.recording import Frame, Recording
from semgp.readers.rgbd import RGBDReader
from semgp.readers.rgbd_text import camera_file, json_camera, json_poses, log_poses, matrix_file, pose_file
from semgp.readers.rgbd_tum import tum

SEVEN_SCENES_CAMERA = Pinhole(fx=585.0, fy=585.0, cx=320.0, cy=240.0)
"""The intrinsics that 7-Scenes states for recordings that come without a file of them."""

IMAGES = (".jpg", ".jpeg", ".png")


def seven_scenes(path: Path) -> Recording:
    """Return a recording of `frame-*.color.png`, `.depth.png` and `.pose.txt` (camera to world).

    Intrinsics are the 3 x 3 matrix of `camera-intrinsics.txt`, in the folder or the one above; without that file,
    those that the data set states.
    """
    files = (folder / "camera-intrinsics.txt" for folder in (path, path.parent))
    intrinsics = next((file for file in files if file.is_file()), None)
    frames = []
    for depth in sorted(path.glob("frame-*.depth.png")):
        stem = depth.name.removesuffix(".depth.png")
        colours = [path / f"{stem}.color{ending}" for ending in IMAGES]
        colour = next((file for file in colours if file.is_file()), colours[-1])
        frames.append(Frame(colour, depth, pose_file(path / f"{stem}.pose.txt")))
    camera = SEVEN_SCENES_CAMERA if intrinsics is None else camera_file(intrinsics)
    return Recording(tuple(frames), camera)


def scannet(path: Path) -> Recording:
    """Return an export of ScanNet: `color/*.jpg`, `depth/*.png`, `pose/*.txt`, `intrinsic/intrinsic_*.txt`.

    Files are named by frame number. Colour and depth are of different sizes, with intrinsics of their own, and
    are taken to look from one place: the exports' `extrinsic_*.txt` must be identities.
    """
    intrinsic = path / "intrinsic"
    for file in sorted(intrinsic.glob("extrinsic_*.txt")):
        if not np.allclose(matrix_file(file, (16,)), np.eye(4), atol=1e-3):
            raise FileFormatError(file, "is no identity: register the depth to the colour images first.")
    colours = {file.stem: file for file in images_in(path / "color")}
    frames = tuple(
        Frame(
            colours.get(depth.stem, path / "color" / f"{depth.stem}.jpg"),
            depth,
            pose_file(path / "pose" / f"{depth.stem}.txt"),
        )
        for depth in sorted(images_in(path / "depth"), key=_by_number)
    )
    of_depth, of_colour = (camera_file(intrinsic / f"intrinsic_{of}.txt") for of in ("depth", "color"))
    return Recording(frames, of_depth, of_colour)


def open3d(path: Path) -> Recording:
    """Return a recording of Open3D's: `color/` or `image/`, `depth/`, an intrinsics file and a trajectory.

    The n-th depth image goes with the n-th colour image and the n-th pose. The trajectory is a `.log` file of
    camera-to-world matrices or a `.json` of Open3D's PinholeCameraTrajectory; the intrinsics are a file such as
    `camera_intrinsic.json`, or those of the trajectory's first camera.
    """
    colours, depths = images_in(_colour_folder(path)), images_in(path / "depth")
    file = _trajectory_file(path)
    poses = log_poses(file) if file.suffix == ".log" else json_poses(file)
    intrinsics = next(iter(sorted(path.glob("*intrinsic*.json"))), None)
    if intrinsics is None and file.suffix == ".log":
        raise FileFormatError(path, "has no intrinsics: write a camera_intrinsic.json, as Open3D does.")
    camera = json_camera(intrinsics or file)
    if not len(colours) == len(depths) == len(poses):
        raise FileFormatError(
            path, f"has {len(colours)} colour images, {len(depths)} depth images and {len(poses)} poses."
        )
    return Recording(tuple(Frame(*of) for of in zip(colours, depths, poses)), camera)


RGBD_READERS = (
    RGBDReader(
        "7scenes",
        "an RGB-D folder like 7-Scenes: frame-*.color.jpg, .depth.png, .pose.txt, camera-intrinsics.txt",
        lambda path: next(path.glob("frame-*.depth.png"), None) is not None,
        seven_scenes,
    ),
    RGBDReader(
        "scannet",
        "an RGB-D folder exported from ScanNet: color/, depth/, pose/, intrinsic/",
        lambda path: all((path / part).is_dir() for part in ("color", "depth", "pose")),
        scannet,
    ),
    RGBDReader(
        "open3d",
        "an RGB-D folder like Open3D's: color/ or image/, depth/, camera_intrinsic.json, trajectory.log or .json",
        lambda path: (path / "depth").is_dir() and _colour_folder(path).is_dir() and not (path / "pose").is_dir(),
        open3d,
    ),
    RGBDReader(
        "tum",
        "an RGB-D folder of TUM's benchmark: rgb.txt, depth.txt, groundtruth.txt",
        lambda path: all((path / name).is_file() for name in ("rgb.txt", "depth.txt", "groundtruth.txt")),
        tum,
    ),
)
"""One reader a layout."""


def images_in(folder: Path) -> list[Path]:
    """Return the images of a folder by name.

    Raises
    ------
    FileFormatError
        A folder without any.
    """
    files = folder.iterdir() if folder.is_dir() else ()
    images = sorted(file for file in files if file.suffix.lower() in IMAGES and file.name[0] != ".")
    if not images:
        raise FileFormatError(folder, "has no .png or .jpg images.")
    return images


def _colour_folder(path: Path) -> Path:
    return path / "color" if (path / "color").is_dir() else path / "image"


def _trajectory_file(path: Path) -> Path:
    """Return the trajectory of an Open3D folder: by its name, there or in the folder `scene` of a rebuilt one."""
    names = ("*trajectory*.log", "*trajectory*.json", "odometry.log", "scene/trajectory.log", "*.log")
    found: Sequence[Path] = [file for name in names for file in sorted(path.glob(name))]
    if not found:
        raise FileFormatError(path, "has no trajectory: trajectory.log or trajectory.json, as Open3D writes them.")
    return found[0]


def _by_number(path: Path) -> tuple[int, str]:
    """Return the key that sorts 2.png before 10.png."""
    digits = re.fullmatch(r"\d{1,18}", path.stem)
    return (int(path.stem) if digits else -1, path.stem)
