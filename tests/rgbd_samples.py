"""Small RGB-D folders of each layout, with a folder `labels` of hard and soft labels."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from semgp.classes import Classes
from semgp.readers.label_folder import open_for_writing, write_labels

SHAPE = (12, 16)
"""Rows and columns of the depth images."""

K = np.array([[20.0, 0, 7.5], [0, 21.0, 5.5], [0, 0, 1]])
CLASSES = Classes(("floor", "wall", "chair"), ((1, 2, 3), (4, 5, 6), (7, 8, 9)))


def pose(i: int) -> NDArray[np.float64]:
    """Return the pose of frame i."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", [0.1 * i, 0.2, 0.3]).as_matrix()
    T[:3, 3] = (i, 0.5, -0.25 * i)
    return T


def depth_image(i: int) -> NDArray[np.uint16]:
    """Return millimetres of frame i; three pixels measured nothing or too far."""
    depth = np.random.default_rng(i).integers(500, 5000, SHAPE).astype(np.uint16)
    depth[0, :3] = (0, 65535, 10001)
    return depth


def colour_image(i: int, shape: tuple[int, int] = SHAPE) -> NDArray[np.uint8]:
    """Return the colours of frame i, which PNG keeps exactly."""
    return np.random.default_rng(100 + i).integers(0, 256, (*shape, 3)).astype(np.uint8)


def label_image(i: int, shape: tuple[int, int] = SHAPE) -> NDArray[np.int64]:
    """Return the labels of frame i."""
    return np.random.default_rng(200 + i).integers(-1, 3, shape)


def probability_image(i: int) -> NDArray[np.float64]:
    """Return the class probabilities of frame i."""
    return np.random.default_rng(300 + i).dirichlet(np.ones(3), (4, 5))


def write_label_folder(path: Path, stems: list[str], shape: tuple[int, int] = SHAPE) -> None:
    """Write labels and probabilities of each image."""
    open_for_writing(path, CLASSES)
    for i, stem in enumerate(stems):
        write_labels(path, stem, label_image(i, shape), 3, probability_image(i))


def save(path: Path, image: NDArray[Any]) -> str:
    """Write an image, its folders first, and return the stem of its name."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(image).save(path)
    return path.stem


def write_seven_scenes(folder: Path) -> Path:
    """Write frames 0, 5 and 10."""
    path = folder / "seven"
    stems = []
    for i in range(3):
        name = f"frame-{5 * i:06d}"
        stems.append(save(path / f"{name}.color.png", colour_image(i)))
        save(path / f"{name}.depth.png", depth_image(i))
        np.savetxt(path / f"{name}.pose.txt", pose(i))
    np.savetxt(path / "camera-intrinsics.txt", K)
    write_label_folder(path / "labels", stems)
    return path


def write_scannet(folder: Path) -> Path:
    """Write frames 8, 9 and 10, colour twice as large as depth."""
    path, shape = folder / "scene0000_00", (2 * SHAPE[0], 2 * SHAPE[1])
    stems = []
    for i in range(3):
        stems.append(save(path / f"color/{8 + i}.png", colour_image(i, shape)))
        save(path / f"depth/{8 + i}.png", depth_image(i))
        (path / "pose").mkdir(exist_ok=True)
        np.savetxt(path / f"pose/{8 + i}.txt", pose(i))
    larger = np.diag([2, 2, 1]) @ K + [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    (path / "intrinsic").mkdir()
    for of, camera in (("depth", K), ("color", larger)):
        matrix = np.eye(4)
        matrix[:3, :3] = camera
        np.savetxt(path / f"intrinsic/intrinsic_{of}.txt", matrix)
        np.savetxt(path / f"intrinsic/extrinsic_{of}.txt", np.eye(4))
    write_label_folder(path / "labels", stems, shape)
    return path


def write_open3d(folder: Path, *, as_json: bool = False) -> Path:
    """Write three frames with a .log trajectory, or a .json one."""
    path = folder / "open3d"
    stems = [save(path / f"color/{i:05d}.png", colour_image(i)) for i in range(3)]
    for i in range(3):
        save(path / f"depth/{i:05d}.png", depth_image(i))
    camera = {"width": SHAPE[1], "height": SHAPE[0], "intrinsic_matrix": K.T.ravel().tolist()}
    if as_json:
        cameras = [{"extrinsic": np.linalg.inv(pose(i)).T.ravel().tolist(), "intrinsic": camera} for i in range(3)]
        trajectory = {"class_name": "PinholeCameraTrajectory", "parameters": cameras}
        (path / "trajectory.json").write_text(json.dumps(trajectory))
    else:
        (path / "camera_intrinsic.json").write_text(json.dumps(camera))
        blocks = [
            f"{i} {i} {i + 1}\n" + "".join(" ".join(map(str, row)) + "\n" for row in pose(i)) for i in range(3)
        ]
        (path / "trajectory.log").write_text("".join(blocks))
    write_label_folder(path / "labels", stems)
    return path


def write_tum(folder: Path) -> Path:
    """Write three frames, 0.1 s apart, depth 0.01 s after colour, a pose every 0.02 s."""
    path = folder / "tum"
    stems, lists = [], {"rgb": "# colour images\n", "depth": "# depth images\n"}
    for i in range(3):
        at = {"rgb": 1305031102 + i / 10, "depth": 1305031102.01 + i / 10}
        for part, image in (("rgb", colour_image(i)), ("depth", 5 * depth_image(i).clip(0, 13107))):
            name = f"{part}/{at[part]:.6f}.png"
            stem = save(path / name, image)
            lists[part] += f"{at[part]:.6f} {name}\n"
            stems += [stem] * (part == "rgb")
    for part, text in lists.items():
        (path / f"{part}.txt").write_text(text)
    rows = []
    for step in range(12):
        T = pose(round(step / 5))
        numbers = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()]
        rows.append(f"{1305031102 + step / 50:.4f} " + " ".join(f"{v:.8f}" for v in numbers))
    (path / "groundtruth.txt").write_text("# stamp tx ty tz qx qy qz qw\n" + "\n".join(rows) + "\n")
    np.savetxt(path / "camera-intrinsics.txt", K)
    write_label_folder(path / "labels", stems)
    return path
