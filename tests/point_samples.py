"""Small point files of the formats that need a writer of their own, and damage to them."""

import tracemalloc
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError
from semgp.readers import open_scans
from semgp.writers import write_las

LARGEST_PEAK = 1 << 28
"""No damaged sample may make a reader ask for more bytes."""

Columns = Mapping[str, NDArray[Any]]


def a_cloud(n: int = 12) -> LabelledCloud:
    rng = np.random.default_rng(0)
    colours = rng.integers(0, 256, (n, 3), np.uint8)
    return LabelledCloud(
        rng.normal(size=(n, 3)), Classes(("mat", "wall")), rng.integers(-1, 2, n, np.int32), colours=colours
    )


def sample_las(folder: Path) -> Path:
    return _las(folder / "a.las")


def sample_laz(folder: Path) -> Path:
    return _las(folder / "a.laz")


def _las(path: Path) -> Path:
    cloud = a_cloud()
    write_las(
        path, cloud.points, classes=cloud.classes, colours=cloud.colours, label=cloud.labels, intensity=range(12)
    )
    return path


def sample_text(folder: Path, suffix: str = ".csv") -> Path:
    path = folder / f"a{suffix}"
    cloud = a_cloud()
    rows = np.column_stack([cloud.points, cloud.hard_labels])
    delimiter = "," if suffix == ".csv" else " "
    np.savetxt(
        path, rows, fmt="%.4f", delimiter=delimiter, header=delimiter.join(("x", "y", "z", "label")), comments=""
    )
    return path


def sample_e57(folder: Path) -> Path:
    rng = np.random.default_rng(0)
    names = ("cartesianX", "cartesianY", "cartesianZ", "intensity", "ext:classification")
    scans = [{name: rng.integers(0, 4, 20 + i).astype(float) for name in names} for i in range(2)]
    return write_e57(folder / "a.e57", scans, [(1, 0, 0, 0, 5e5, 0, 2), None])


def write_e57(path: Path, scans: Sequence[Columns], poses: Sequence[tuple[float, ...] | None]) -> Path:
    """Write scans with poses w x y z of the rotation, then the translation."""
    from pye57 import libe57

    image = libe57.ImageFile(str(path), "w")
    image.extensionsAdd("", libe57.E57_V1_0_URI)
    image.extensionsAdd("ext", "http://example.org/labels")

    def structure(**parts: Any) -> Any:
        node = libe57.StructureNode(image)
        for name, part in parts.items():
            node.set(name, part)
        return node

    def numbers(**values: float) -> Any:
        return structure(**{name: libe57.FloatNode(image, value) for name, value in values.items()})

    root = image.root()
    root.set("formatName", libe57.StringNode(image, "ASTM E57 3D Imaging Data File"))
    root.set("guid", libe57.StringNode(image, "{1}"))
    for name in ("versionMajor", "versionMinor"):
        root.set(name, libe57.IntegerNode(image, int(name == "versionMajor")))
    data = libe57.VectorNode(image, True)
    root.set("data3D", data)
    for columns, pose in zip(scans, poses, strict=True):
        node = structure(guid=libe57.StringNode(image, "{2}"))
        if pose is not None:
            rotation, translation = numbers(**dict(zip("wxyz", pose))), numbers(**dict(zip("xyz", pose[4:])))
            node.set("pose", structure(rotation=rotation, translation=translation))
        row = structure(**{name: libe57.FloatNode(image, 0.0, libe57.E57_DOUBLE) for name in columns})
        points = libe57.CompressedVectorNode(image, row, libe57.VectorNode(image, True))
        node.set("points", points)
        data.append(node)
        buffers = libe57.VectorSourceDestBuffer()
        copies = {name: np.array(values, dtype=np.float64) for name, values in columns.items()}
        for name, values in copies.items():
            buffers.append(libe57.SourceDestBuffer(image, name, values, len(values), True, True))
        writer = points.writer(buffers)
        writer.write(len(next(iter(columns.values()))))
        writer.close()
    image.close()
    return path


def lzf_packed(raw: bytes) -> bytes:
    """Pack bytes by LZF, the slow and plain way: copy the longest run met before, if three bytes or more."""
    packed, at, literal = bytearray(), 0, bytearray()

    def flush() -> None:
        for start in range(0, len(literal), 32):
            part = literal[start : start + 32]
            packed.extend((len(part) - 1, *part))
        literal.clear()

    while at < len(raw):
        length, back = 0, 0
        for start in range(max(0, at - 8192), at):
            run = 0
            while run < 264 and at + run < len(raw) and raw[start + run] == raw[at + run]:
                run += 1
            if run > length:
                length, back = run, at - start - 1
        if length < 3:
            literal.append(raw[at])
            at += 1
            continue
        flush()
        short = min(length - 2, 7)
        packed.append(short << 5 | back >> 8)
        packed.extend((length - 9, back & 255) if short == 7 else (back & 255,))
        at += length
    flush()
    return bytes(packed)


Damage = tuple[float, list[tuple[float, int]]]
damages: st.SearchStrategy[Damage] = st.tuples(
    st.one_of(st.just(1.0), st.floats(0, 1)),
    st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), max_size=4),
)
"""How much of a file is left, and where which bytes of it are others."""


def survives(path: Path, whole: bytes, damage: Damage) -> None:
    """Damage a file and read it: a FileFormatError or sound clouds, and no giant allocation."""
    share, changes = damage
    left = bytearray(whole[: round(share * len(whole))])
    for where, value in changes:
        if left:
            left[int(where * len(left))] = value
    path.write_bytes(left)
    tracemalloc.start()
    try:
        for cloud in open_scans(path):
            assert np.isfinite(cloud.points).all()
    except FileFormatError:
        pass
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < LARGEST_PEAK
