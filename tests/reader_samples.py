"""Small files and folders of each layout that the readers read."""

from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgp.classes import Classes
from semgp.cloud import LabelledCloud

SHAPE = (24, 32)
"""Rows and columns of the NYU samples."""

RAW_NAMES = ("book", "wall", "floor", "chandelier", "refridgerator", "bottle", "bed")
"""Raw names of the NYU .mat sample."""

TR = np.array([[0.0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1]])
"""Velodyne to camera in the SemanticKITTI sample."""


def write_pcd(path: Path, cloud: LabelledCloud, data: Literal["ascii", "binary"]) -> Path:
    """Write points and labels as PCL does."""
    n = len(cloud)
    rows = np.empty(n, dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("label", "<u4")])
    for axis, name in enumerate("xyz"):
        rows[name] = cloud.points[:, axis]
    rows["label"] = cloud.hard_labels.astype(np.uint32)
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z label\nSIZE 4 4 4 4\n"
        f"TYPE F F F U\nCOUNT 1 1 1 1\nWIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA {data}\n"
    )
    text = "".join(f"{x:.9g} {y:.9g} {z:.9g} {label}\n" for x, y, z, label in rows.tolist())
    path.write_bytes(header.encode() + (rows.tobytes() if data == "binary" else text.encode()))
    return path


def write_nyu_folder(folder: Path) -> Path:
    """Write two frames, 7 and 12, the second with pixels without depth."""
    folder = folder / "nyu"
    folder.mkdir()
    rng = np.random.default_rng(3)
    for number in (7, 12):
        depth = rng.integers(500, 5000, SHAPE).astype(np.uint16)
        if number == 12:
            depth[0, :3] = (0, 65535, 10001)
        probability = rng.dirichlet(np.ones(32), (8, 8))
        images: dict[str, NDArray[Any]] = {
            "depth_mm.png": depth,
            "label13.png": rng.integers(0, 14, SHAPE).astype(np.uint8),
            "label40.png": rng.integers(0, 41, SHAPE).astype(np.uint8),
            "mosaic_nyu13.png": rng.integers(0, 14, SHAPE).astype(np.uint8),
            "rgb.jpg": rng.integers(0, 256, (*SHAPE, 3)).astype(np.uint8),
        }
        for ending, image in images.items():
            Image.fromarray(image).save(folder / f"{number:04d}_{ending}")
        np.savez_compressed(
            folder / f"{number:04d}_mosaic_prob128.npz", p=np.round(255 * probability).astype(np.uint8)
        )
    return folder


def write_nyu_mat(folder: Path) -> Path:
    """Write three frames as MATLAB 7.3 lays them out: everything transposed, names as references."""
    import h5py

    rng = np.random.default_rng(4)
    height, width = SHAPE
    path = folder / "nyu_depth_v2_labeled.mat"
    with h5py.File(path, "w") as file:
        file["images"] = rng.integers(0, 256, (3, 3, width, height)).astype(np.uint8)
        file["depths"] = rng.uniform(0.5, 5, (3, width, height)).astype(np.float32)
        file["labels"] = rng.integers(0, len(RAW_NAMES) + 1, (3, width, height)).astype(np.uint16)
        references = file.create_dataset("names", (1, len(RAW_NAMES)), dtype=h5py.ref_dtype)
        for k, name in enumerate(RAW_NAMES):
            text = file.create_dataset(f"#refs#/{k}", data=np.array([[ord(c)] for c in name], np.uint16))
            references[0, k] = text.ref
    return path


def write_log(folder: Path) -> Path:
    """Write a ROS 2 bag of three clouds of a lidar that moves."""
    from semgp.logs.recording import write_clouds

    rng = np.random.default_rng(6)
    poses = [np.block([[np.eye(3), np.full((3, 1), step)], [np.zeros((1, 3)), 1]]) for step in range(3)]
    clouds = [
        LabelledCloud(
            rng.normal(size=(20, 3)),
            Classes(("road", "car")),
            rng.integers(-1, 2, 20).astype(np.int32),
            T_world_sensor=T,
        )
        for T in poses
    ]
    write_clouds(folder / "run.mcap", clouds)
    return folder / "run.mcap"


def write_kitti_bin(folder: Path) -> Path:
    """Write one scan of 40 points by itself, with its labels beside it."""
    rng = np.random.default_rng(7)
    rng.uniform(-20, 20, (40, 4)).astype("<f4").tofile(folder / "000007.bin")
    rng.choice([0, 10, 40, 252], 40).astype("<u4").tofile(folder / "000007.label")
    return folder / "000007.bin"


def write_point_folder(folder: Path) -> Path:
    """Write three PCD files, named 9, 10 and 11, of 9, 10 and 11 points."""
    path = folder / "pieces"
    path.mkdir()
    rng = np.random.default_rng(8)
    for n in (9, 10, 11):
        cloud = LabelledCloud(rng.normal(size=(n, 3)), Classes.numbered(3), rng.integers(0, 3, n, np.int32))
        write_pcd(path / f"{n}.pcd", cloud, "binary")
    return path


def write_kitti_sequence(folder: Path) -> Path:
    """Write three scans, numbers 0, 1 and 3, each a step of one metre forward from the one before."""
    path = folder / "dataset" / "sequences" / "08"
    rng = np.random.default_rng(5)
    for part in ("velodyne", "labels", "predictions"):
        (path / part).mkdir(parents=True)
    for number in (0, 1, 3):
        points = rng.uniform(-20, 20, (50 + number, 4)).astype("<f4")
        points.tofile(path / "velodyne" / f"{number:06d}.bin")
        for part in ("labels", "predictions"):
            ids = rng.choice([0, 10, 40, 50, 70, 252], len(points)).astype("<u4") | 3 << 16
            ids.tofile(path / part / f"{number:06d}.label")
    poses = np.tile(np.eye(3, 4).ravel(), (4, 1))
    poses[:, 11] = range(4)
    np.savetxt(path / "poses.txt", poses, fmt="%g")
    lines = ("P0: " + " ".join(["0"] * 12), "Tr: " + " ".join(f"{v:g}" for v in TR[:3].ravel()))
    (path / "calib.txt").write_text("\n".join(lines) + "\n")
    return path
