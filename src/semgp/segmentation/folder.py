"""Images to a label folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from semgp.errors import InputError
from semgp.readers.images import read_colour_image
from semgp.readers.label_folder import open_for_writing, write_labels
from semgp.segmentation.protocol import Segmenter


def unlabelled(images: Sequence[Path], out: Path) -> list[Path]:
    """Return the images of which a label folder does not hold the labels yet.

    Raises
    ------
    InputError
        Two images whose labels would have one name, or images in the label folder itself.
    """
    _require_apart(images, out)
    return [image for image in images if not (out / f"{image.stem}.png").is_file()]


def segment_images(
    images: Sequence[Path], segmenter: Segmenter, out: str | Path, *, soft: bool = True
) -> Iterator[tuple[Path, float]]:
    """Write the labels of images to a label folder (see `semgp.readers.label_folder`), one by one.

    Each file is whole or not there, the label image last: after an interruption `unlabelled` tells what is left.

    Parameters
    ----------
    images : sequence of Path
        Colour images.
    segmenter : Segmenter
        The network.
    out : str or Path
        The folder; made where it does not exist, and checked to be of the segmenter's classes where it does.
    soft : bool
        Write class probabilities, too, where the network gives them.

    Yields
    ------
    image : Path
        The image whose labels have been written.
    labelled : float
        Fraction of its pixels that have a label.

    Raises
    ------
    InputError
        As `unlabelled`, or a folder that holds labels of other classes; FileFormatError for an image that is
        damaged.
    """
    _require_apart(images, Path(out))
    open_for_writing(out, segmenter.classes)
    for image in images:
        answer = segmenter.segment(read_colour_image(image))
        probability = answer.probability if soft else None
        write_labels(out, image.stem, answer.label, len(segmenter.classes), probability, corners=answer.corners)
        yield image, float((answer.label >= 0).mean())


def _require_apart(images: Sequence[Path], out: Path) -> None:
    """Raise InputError for images whose labels would overwrite them or each other."""
    if any(image.resolve().parent == out.resolve() for image in images):
        raise InputError(f"{out} holds the images: give another folder for their labels.")
    counts = Counter(image.stem for image in images)
    if twice := next((stem for stem, n in counts.items() if n > 1), None):
        raise InputError(f"{counts[twice]} images are called {twice}: label each folder of images into its own.")
