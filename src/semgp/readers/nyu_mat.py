"""NYU Depth V2 as its authors publish it: `nyu_depth_v2_labeled.mat`, a MATLAB 7.3 (HDF5) file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from semgp.camera import NYU_CAMERA, cloud_from_depth
from semgp.classes import MISSING, Classes
from semgp.conventions import NYU40, NYU40_TO_NYU13, relabel
from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.readers.images import LARGEST_IMAGE
from semgp.readers.nyu import ClassCount, NYUFrame, class_count, nyu_classes, require_frame
from semgp.readers.protocol import Scans

ARRAYS = ("images", "depths", "labels")

LONGEST_NAME, MOST_NAMES = 256, 1 << 16

PLAIN_NAMES: Mapping[str, str] = {
    **{name: name for name in NYU40.names},
    **dict.fromkeys(("book",), "books"),
    **dict.fromkeys(("refridgerator",), "refrigerator"),
    **dict.fromkeys(("coffee table", "dining table"), "table"),
    **dict.fromkeys(("column", "stairs"), "otherstructure"),
    **dict.fromkeys(("bench", "ottoman", "tv stand"), "otherfurniture"),
    **dict.fromkeys(("ball", "basket", "bottle", "bowl", "candle", "clock", "computer", "cup"), "otherprop"),
    **dict.fromkeys(("flower pot", "keyboard", "laptop", "monitor", "mouse", "plant"), "otherprop"),
    **dict.fromkeys(("plate", "remote control", "speaker", "stuffed animal", "telephone"), "otherprop"),
    **dict.fromkeys(("toilet paper", "toy", "vase"), "otherprop"),
}
"""NYU40 class of the raw names whose class is plain from the name.

The file has 894 raw names, and Gupta et al. (2013) gave each one of the 40 classes in a file of their own,
which semgp does not have. This table is no substitute for it: it holds the class names themselves and a few
dozen others that the definition of the classes decides, and leaves every further name *missing* rather than
guess. So its labels are a part of the official ones, and figures made with them are not those of the papers.
"""


class NYUMat:
    """The frames of `nyu_depth_v2_labeled.mat`.

    Read by h5py, MATLAB's arrays come transposed: `images` (N, 3, W, H) uint8, `depths` (N, W, H) in metres,
    in-painted, `labels` (N, W, H) with 0 = unlabelled and k = the k-th of `names`.

    Parameters
    ----------
    path : str or Path
        The file.
    nyu40_of_name : mapping of str to str
        NYU40 class of each raw name; raw names that it lacks are missing labels. Give the official map where
        you have it; the default, `PLAIN_NAMES`, knows only some.

    Raises
    ------
    InputError
        A map to something that is no NYU40 class.
    FileFormatError
        A file that is missing, damaged or truncated, or of another layout.
    MissingExtraError
        h5py is not installed.
    """

    def __init__(self, path: str | Path, nyu40_of_name: Mapping[str, str] = PLAIN_NAMES) -> None:
        self.path = Path(path)
        with _opened(self.path) as file:
            n, width, height = _checked_shape(self.path, file)
            names = _raw_names(self.path, file)
        self.frames: Sequence[int] = range(1, n + 1)
        self._shape = (height, width)
        labels = [NYU40.index(nyu40_of_name[name]) if name in nyu40_of_name else MISSING for name in names]
        self._nyu40_of_id = np.array([MISSING, *labels], dtype=np.int32)

    def read(self, frame: int, classes: ClassCount = 13) -> NYUFrame:
        """Read a frame with its true labels, as `NYUFolder.read` does; there is no network output.

        Parameters
        ----------
        frame : int
            Frame number, one of `frames`, from 1.
        classes : 13 or 40
            Which class list.

        Raises
        ------
        InputError
            No such frame or class list.
        FileFormatError
            A damaged file.
        """
        names = nyu_classes(classes)
        require_frame(frame, self.frames)
        with _opened(self.path) as file:
            image, depth, ids = (file[key][frame - 1].T for key in ARRAYS)
        if ids.max() >= len(self._nyu40_of_id):
            raise FileFormatError(self.path, f"has labels up to {ids.max()} in frame {frame}, beyond its names.")
        labels = self._nyu40_of_id[ids]
        if classes == 13:
            labels = relabel(labels, NYU40_TO_NYU13)
        cloud = cloud_from_depth(depth, NYU_CAMERA, names, labels, colours=image)
        return NYUFrame(frame, cloud, self._shape)


@dataclass(frozen=True)
class NYUMatReader:
    """The registry's reader of `nyu_depth_v2_labeled.mat`."""

    name: str = "nyu-mat"
    layout: str = "nyu_depth_v2_labeled.mat, the official file of NYU Depth V2"

    def matches(self, path: Path) -> bool:
        """Tell whether the path is a .mat file."""
        return path.is_file() and path.suffix.lower() == ".mat"

    def scans(
        self, path: Path, *, classes: ClassCount | Classes = 13, nyu40_of_name: Mapping[str, str] = PLAIN_NAMES
    ) -> Scans:
        """Return the frames of the file; see `NYUMat` for the options."""
        source = NYUMat(path, nyu40_of_name)
        count = class_count(classes)
        return Scans(source.frames, lambda frame: source.read(frame, count).cloud)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open an HDF5 file; what h5py raises on damaged files becomes a FileFormatError."""
    try:
        import h5py
    except ImportError as error:
        raise MissingExtraError("reading nyu_depth_v2_labeled.mat", "nyu") from error
    try:
        with h5py.File(path, "r") as file:
            yield file
    except InputError:
        raise
    except FileNotFoundError as error:
        raise FileFormatError(path, "no such file.") from error
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        raise FileFormatError(path, f"is no MATLAB 7.3 file of NYU Depth V2, or is damaged: {error}") from error


def _checked_shape(path: Path, file: Any) -> tuple[int, int, int]:
    """Return the number, width and height of the frames."""
    images, depths, labels = (_dataset(path, file[key]) for key in ARRAYS)
    n, width, height = labels.shape
    if images.shape != (n, 3, width, height) or depths.shape != (n, width, height):
        raise FileFormatError(
            path, f"has images {images.shape}, depths {depths.shape}, labels {labels.shape}: they do not fit."
        )
    if images.dtype != np.uint8 or depths.dtype.kind != "f" or labels.dtype.kind not in "u":
        raise FileFormatError(
            path, f"has images of {images.dtype}, depths of {depths.dtype}, labels of {labels.dtype}."
        )
    if not n or not 0 < width * height <= LARGEST_IMAGE:
        raise FileFormatError(path, f"has {n} frames of {width} x {height} pixels.")
    return n, width, height


def _raw_names(path: Path, file: Any) -> list[str]:
    """Return the raw names: a cell array, so references to arrays of character codes."""
    cells = _dataset(path, file["names"])
    if not 0 < cells.size <= MOST_NAMES:
        raise FileFormatError(path, f"has {cells.size} names.")
    texts = [_dataset(path, file[reference]) for reference in cells[()].ravel()]
    if any(text.size > LONGEST_NAME or text.dtype.kind != "u" for text in texts):
        raise FileFormatError(path, "has names that are no cell array of texts.")
    return ["".join(map(chr, text[()].ravel())) for text in texts]


def _dataset(path: Path, node: Any) -> Any:
    """Check that a node of the file is an array."""
    import h5py

    if not isinstance(node, h5py.Dataset):
        raise FileFormatError(path, f"has a {type(node).__name__} where an array must be.")
    return node
