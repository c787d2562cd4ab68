"""Labels from images: a segmentation network in a .tflite or .onnx file, and what it says of images and scans.

>>> segmenter = open_segmenter("net.onnx")  # doctest: +SKIP
>>> segmenter.segment(image).label  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from semgp.class_files import ClassFile
from semgp.classes import Classes
from semgp.errors import InputError
from semgp.segmentation.card import ModelCard, read_card
from semgp.segmentation.images import images_of
from semgp.segmentation.mapped import MappedSegmenter
from semgp.segmentation.network import NetworkSegmenter, n_classes
from semgp.segmentation.onnx import ONNXNetwork
from semgp.segmentation.protocol import Network, Segmentation, Segmenter
from semgp.segmentation.scans import labelled_scans
from semgp.segmentation.tflite import TFLiteNetwork

__all__ = [
    "MappedSegmenter",
    "ModelCard",
    "Segmentation",
    "Segmenter",
    "images_of",
    "labelled_scans",
    "open_segmenter",
    "segmenter_of",
]

NETWORKS: dict[str, Callable[[Path, str | None], Network]] = {".tflite": TFLiteNetwork, ".onnx": ONNXNetwork}
"""What opens a network, by its file's ending."""


def open_segmenter(path: str | Path, classes: Classes | None = None, card: ModelCard | None = None) -> Segmenter:
    """Return the network in a file.

    Parameters
    ----------
    path : str or Path
        A .tflite or .onnx file.
    classes : Classes, optional
        The network's classes; left out, those of its card, or else numbered ones.
    card : ModelCard, optional
        What the file does not say; left out, the TOML of the same name beside it, see `semgp.segmentation.card`.

    Raises
    ------
    InputError
        Another ending, or a network that is none of images; FileFormatError for a file that is damaged.
    MissingExtraError
        Without the extra `segment`.
    """
    path = Path(path)
    if path.suffix.lower() not in NETWORKS:
        raise InputError(f"{path}: a network is a file that ends in {' or '.join(NETWORKS)}.")
    if not path.is_file():
        raise InputError(f"{path}: no such file.")
    card = read_card(path) if card is None else card
    network: Network = NETWORKS[path.suffix.lower()](path, card.logits)
    known = classes or card.classes
    if known is None:
        count = n_classes(network, card)
        if count is None:
            raise InputError(f"{path} does not say its classes: name them in a model card {path.stem}.toml.")
        known = Classes.numbered(count)
    return NetworkSegmenter(network, known, card)


def segmenter_of(path: str | Path, classes: Classes | None = None, mapping: ClassFile | None = None) -> Segmenter:
    """Return the network in a file, in the classes of a mapping, where one is given.

    See Also
    --------
    open_segmenter, MappedSegmenter
    """
    segmenter = open_segmenter(path, classes)
    return segmenter if mapping is None else MappedSegmenter(segmenter, mapping)
