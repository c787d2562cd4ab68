"""E57 files (ASTM E2807): the scans of a terrestrial scanner, each with its pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, MissingExtraError
from semgp.readers.fields import cloud_from_fields
from semgp.readers.protocol import Scans

MAGIC = b"ASTM-E57"

POINTS_AT_ONCE = 1 << 18
"""Points are read by so many at a time, for a file may promise more than there are."""

MOST_PER_BYTE = 8
"""Fields that are the same everywhere take no room in a file; coordinates take one bit a point at least."""

CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
COLOURS = {"red": "colorRed", "green": "colorGreen", "blue": "colorBlue"}


class E57Reader:
    """The scans of an `.e57` file."""

    name = "e57"
    layout = "an .e57 file of scans"

    def matches(self, path: Path) -> bool:
        """Tell whether the path is a file with the extension."""
        return path.is_file() and path.suffix.lower() == ".e57"

    def scans(
        self,
        path: Path,
        *,
        classes: Classes | None = None,
        features: Sequence[str] = (),
        field: str | None = None,
    ) -> Sequence[LabelledCloud]:
        """Return the scans; options as in `read_e57`."""
        with _opened(path) as root:
            n = len(root["data3D"])
        return Scans(range(n), lambda i: read_e57(path, i, classes=classes, features=features, field=field))


def read_e57(
    path: str | Path,
    scan: int = 0,
    *,
    classes: Classes | None = None,
    features: Sequence[str] = (),
    field: str | None = None,
) -> LabelledCloud:
    """Read one scan of an E57 file; see `cloud_from_fields` for what its fields mean.

    The points, which E57 keeps in the scanner's frame, are taken to the file's by the scan's pose, which becomes
    `T_world_sensor`. Points whose coordinates are marked as invalid are left out, and colours are scaled to 8 bits
    by the limits that the scan declares. The format itself has no labels: a field of an extension may hold them,
    such as `classification`; a prefix, as in `ext:classification`, does not count.

    Parameters
    ----------
    path : str or Path
        The file.
    scan : int, optional
        Which of its scans.
    classes : Classes, optional
        Classes of the labels. Left out, they are named after the soft labels, or numbered.
    features : sequence of str
        Fields that become the cloud's features, such as `intensity`.
    field : str, optional
        The field that holds the labels, where it is none of `fields.LABEL_NAMES`.

    Raises
    ------
    MissingExtraError
        Without the extra `e57`.
    FileFormatError
        A file that is no E57 file, is damaged or truncated, or lacks a field.
    """
    path = Path(path)
    with _opened(path) as root:
        node = root["data3D"][scan]
        T_world_sensor = _pose(node) if node.isDefined("pose") else None
        columns = _columns(path, node)
        columns |= _colours(node, columns)
    points = _points(path, columns)
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite the cloud refuses
        if T_world_sensor is not None:
            points = points @ T_world_sensor[:3, :3].T + T_world_sensor[:3, 3]
    state = columns.get("cartesianInvalidState", columns.get("sphericalInvalidState"))
    kept = slice(None) if state is None else state == 0
    fields = {name.rpartition(":")[2]: column[kept] for name, column in columns.items()}
    fields |= dict(zip("xyz", points[kept].T))
    return cloud_from_fields(path, fields, classes, features, field, T_world_sensor)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Yield the root of a file; what libE57Format raises about the file becomes a FileFormatError."""
    try:
        from pye57 import libe57
    except ImportError as error:
        raise MissingExtraError("reading E57 files", "e57") from error
    with path.open("rb") as file:
        if file.read(8) != MAGIC:
            raise FileFormatError(path, "is no E57 file: it does not begin with ASTM-E57.")
    image = None
    try:
        image = libe57.ImageFile(str(path), "r")
        yield image.root()
    except FileFormatError:
        raise
    except (
        libe57.E57Exception,
        RuntimeError,
        ValueError,
        TypeError,
        AttributeError,
        IndexError,
        KeyError,
    ) as error:
        problem = str(error).split(" ****")[0]  # what follows is for debuggers
        raise FileFormatError(path, f"is no E57 file, or is damaged: {problem}") from error
    finally:
        if image is not None:
            image.close()


def _columns(path: Path, node: Any) -> dict[str, NDArray[np.float64]]:
    """Return all fields of a scan's points that hold numbers."""
    from pye57 import libe57

    vector = node["points"]
    prototype = libe57.StructureNode(vector.prototype())
    parts_of_row = [prototype.get(i) for i in range(prototype.childCount())]
    names = [part.elementName() for part in parts_of_row if part.type() != libe57.NodeType.E57_STRING]
    if vector.childCount() > MOST_PER_BYTE * path.stat().st_size:
        raise FileFormatError(path, f"cannot hold the {vector.childCount():,} points that it declares.")
    buffers = libe57.VectorSourceDestBuffer()
    chunk = {name: np.empty(POINTS_AT_ONCE) for name in names}
    for name, values in chunk.items():
        buffers.append(libe57.SourceDestBuffer(node.destImageFile(), name, values, POINTS_AT_ONCE, True, True))
    reader = vector.reader(buffers)
    parts: list[dict[str, NDArray[np.float64]]] = []
    while n := reader.read():
        parts.append({name: values[:n].copy() for name, values in chunk.items()})
    reader.close()
    if (found := sum(len(part[names[0]]) for part in parts)) != vector.childCount():
        raise FileFormatError(path, f"is truncated: of {vector.childCount()} points there are {found}.")
    return {name: np.concatenate([part[name] for part in parts] or [np.empty(0)]) for name in names}


def _points(path: Path, columns: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the positions (N, 3) in the scanner's frame."""
    if columns.keys() >= set(CARTESIAN):
        return np.stack([columns[name] for name in CARTESIAN], axis=1)
    if not columns.keys() >= set(SPHERICAL):
        raise FileFormatError(path, f"has no coordinates; its fields are {', '.join(columns)}.")
    distance, azimuth, elevation = (columns[name] for name in SPHERICAL)
    with np.errstate(invalid="ignore", over="ignore"):
        level = distance * np.cos(elevation)
        return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)], axis=1)


def _colours(node: Any, columns: dict[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Return red, green and blue from 0 to 255."""
    if not columns.keys() >= set(COLOURS.values()):
        return {}
    found = {}
    for name, field in COLOURS.items():
        low, high = 0.0, 255.0
        if node.isDefined("colorLimits"):
            low, high = (float(node["colorLimits"][f"{field}{end}"].value()) for end in ("Minimum", "Maximum"))
        with np.errstate(over="ignore", invalid="ignore"):  # what is no colour is refused with the other fields
            scaled = np.round((columns[field] - low) * (255 / (high - low))) if high > low else columns[field]
        found[name] = scaled
    return found


def _pose(node: Any) -> NDArray[np.float64]:
    """Return the pose of a scan; a part that it leaves out is that of no rotation or no translation."""
    pose = node["pose"]
    T_world_sensor = np.eye(4)
    if pose.isDefined("rotation"):
        w, x, y, z = (float(pose["rotation"][name].value()) for name in "wxyz")
        T_world_sensor[:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix()
    if pose.isDefined("translation"):
        T_world_sensor[:3, 3] = [float(pose["translation"][name].value()) for name in "xyz"]
    return T_world_sensor
