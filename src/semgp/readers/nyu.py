"""NYU Depth V2 (Silberman et al., 2012) as a folder of images, with the outputs of a network beside them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from semgp.camera import NYU_CAMERA, cloud_from_depth
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.conventions import NYU13, NYU40, labels_from_nyu
from semgp.errors import FileFormatError, InputError
from semgp.readers.images import read_colour_image, read_depth, read_label_image
from semgp.readers.label_folder import LabelFolder
from semgp.readers.nyu_network import network_probability_image
from semgp.readers.protocol import Scans

ClassCount = Literal[13, 40]

DEPTH_NAME = re.compile(r"(\d{4})_depth_mm\.png")


@dataclass(frozen=True, eq=False)
class NYUFrame:
    """One labelled frame.

    Parameters
    ----------
    number : int
        Frame number, from 1, as in the papers.
    cloud : LabelledCloud
        The valid pixels with their true labels, in the camera's optical frame (z forward).
    shape : (int, int)
        Rows and columns of the images.
    folder : Path, optional
        Where the outputs of the network lie.
    """

    number: int
    cloud: LabelledCloud
    shape: tuple[int, int]
    folder: Path | None = None

    @property
    def network_labels(self) -> NDArray[np.int32]:
        """NYU13 labels (N,) that the network gave the points; missing where its class has no counterpart.

        Raises
        ------
        InputError
            A frame that comes without network output; FileFormatError where that is damaged.
        """
        path = self._network_file("mosaic_nyu13.png")
        return self._at_points(_labels(path, self.shape, NYU13))

    @property
    def network_probability(self) -> NDArray[np.float32]:
        """Probability (N, 13) that the network gave each NYU13 class at the points.

        What a row lacks to one is the mass of the network's classes without a counterpart.

        Raises
        ------
        InputError
            A frame that comes without network output; FileFormatError where that is damaged.
        """
        path = self._network_file("mosaic_prob128.npz")
        return self._at_points(network_probability_image(path, self.shape))

    def _network_file(self, ending: str) -> Path:
        if self.folder is None:
            raise InputError(f"frame {self.number} comes without network output: use the folder of images.")
        return self.folder / f"{self.number:04d}_{ending}"

    def _at_points(self, image: NDArray[Any]) -> NDArray[Any]:
        rows, columns = np.asarray(self.cloud.pixels).T
        return np.asarray(image[rows, columns])


class NYUSource(Protocol):
    """A source of labelled frames: the folder of images, or the official file."""

    @property
    def frames(self) -> Sequence[int]:
        """Numbers of the frames, ascending."""
        ...

    def read(self, frame: int, classes: ClassCount = 13) -> NYUFrame:
        """Read a frame with its true labels."""
        ...


class NYUFolder:
    """Files `NNNN_depth_mm.png`, `NNNN_rgb.jpg`, `NNNN_label13.png` and `NNNN_label40.png`.

    With the outputs of a network beside them: `NNNN_mosaic_nyu13.png` and `NNNN_mosaic_prob128.npz`.

    Parameters
    ----------
    path : str or Path
        The folder.

    Raises
    ------
    FileFormatError
        A folder without depth images.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        matches = (DEPTH_NAME.fullmatch(p.name) for p in self.path.glob("*_depth_mm.png"))
        self._frames = tuple(sorted(int(m[1]) for m in matches if m))
        if not self._frames:
            raise FileFormatError(self.path, "is no NYU folder: it has no file NNNN_depth_mm.png.")

    @property
    def frames(self) -> Sequence[int]:
        """Numbers of the frames, ascending."""
        return self._frames

    def read(self, frame: int, classes: ClassCount = 13) -> NYUFrame:
        """Read a frame with its true labels.

        Parameters
        ----------
        frame : int
            Frame number, one of `frames`.
        classes : 13 or 40
            Which class list.

        Raises
        ------
        InputError
            No such frame or class list.
        FileFormatError
            Images that are missing, damaged, truncated or of different sizes.
        """
        names = nyu_classes(classes)
        require_frame(frame, self.frames)
        stem = f"{frame:04d}"
        depth = read_depth(self.path / f"{stem}_depth_mm.png")
        shape = (depth.shape[0], depth.shape[1])
        labels = _labels(self.path / f"{stem}_label{classes}.png", shape, names)
        colours = read_colour_image(self.path / f"{stem}_rgb.jpg", shape)
        cloud = cloud_from_depth(depth, NYU_CAMERA, names, labels, colours=colours)
        return NYUFrame(frame, cloud, shape, self.path)


@dataclass(frozen=True)
class NYUFolderReader:
    """The registry's reader of NYU folders, and of one frame by its depth image."""

    name: str = "nyu"
    layout: str = "a folder of NYU frames NNNN_depth_mm.png, NNNN_rgb.jpg, NNNN_label13.png; or one depth image"

    def matches(self, path: Path) -> bool:
        """Tell whether the path is a depth image of an NYU folder, or a folder with some."""
        return any(DEPTH_NAME.fullmatch(p.name) for p in (path.iterdir() if path.is_dir() else (path,)))

    def scans(
        self,
        path: Path,
        *,
        classes: ClassCount | Classes = 13,
        labels: str | Path = "labels",
    ) -> Scans:
        """Return the frames of a folder, or the one of a depth image.

        Parameters
        ----------
        path : Path
            The folder, or a `NNNN_depth_mm.png` in it.
        classes : 13, 40, NYU13 or NYU40
            Which class list.
        labels : "labels", "predictions", str or Path
            The true labels, those of the network, which are for 13 classes only, or a folder of labels of the
            colour images (see `semgp.readers.label_folder`).
        """
        folder = NYUFolder(path if path.is_dir() else path.parent)
        match = DEPTH_NAME.fullmatch(path.name)
        count = class_count(classes)
        images = None if labels in ("labels", "predictions") else LabelFolder(labels)
        if labels == "predictions" and count != 13:
            raise InputError("labels is 'labels', a folder of labels, or with 13 classes 'predictions'.")

        def scan(frame: int) -> LabelledCloud:
            read = folder.read(frame, count)
            if images is not None:
                return images.labelled(read.cloud, f"{frame:04d}_rgb")
            return read.cloud if labels == "labels" else replace(read.cloud, labels=read.network_labels)

        return Scans((int(match[1]),) if match else folder.frames, scan)


def class_count(classes: ClassCount | Classes) -> ClassCount:
    """Return 13 or 40 for a class list of NYU Depth V2, or for the number itself.

    Raises
    ------
    InputError
        Another class list.
    """
    count = len(classes) if isinstance(classes, Classes) else classes
    own = nyu_classes(count)
    if isinstance(classes, Classes) and not classes.nameless and classes.names != own.names:
        raise InputError(
            f"NYU Depth V2 has the class lists nyu13 and nyu40, not {', '.join(classes.names[:3])} ..."
        )
    return 13 if count == 13 else 40


def nyu_classes(count: int) -> Classes:
    """Return the NYU class list of 13 or 40 classes.

    Raises
    ------
    InputError
        Another number of classes.
    """
    if count not in (13, 40):
        raise InputError(
            f"NYU Depth V2 has a class list of 13 and one of 40 classes (nyu13, nyu40), none of {count}."
        )
    return NYU13 if count == 13 else NYU40


def require_frame(frame: int, frames: Sequence[int]) -> None:
    """Check that a source has a frame.

    Raises
    ------
    InputError
        It has not.
    """
    if frame not in frames:
        raise InputError(
            f"there is no frame {frame}: there are {len(frames)} from {min(frames)} to {max(frames)}."
        )


def _labels(path: Path, shape: tuple[int, int], classes: Classes) -> NDArray[np.int32]:
    try:
        return labels_from_nyu(read_label_image(path, shape), classes)
    except FileFormatError:
        raise
    except InputError as error:
        raise FileFormatError(path, str(error)) from error
