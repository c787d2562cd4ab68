"""`semgp segment`: images to labels, by a network."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from semgp.cli.places import require_place


def segment(
    images: list[Path],
    /,
    *,
    model: Annotated[Path, Parameter(name=("--model", "--network"))],
    out: Path,
    labels: Annotated[str | None, Parameter(name=("--labels", "--remap"))] = None,
    classes: str | None = None,
    soft: bool = True,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Label images by a segmentation network, and write labels and class probabilities to a folder.

    "semgp build FOLDER --labels OUT" takes them. Images that have labels there already are left out, so that the
    same command goes on after an interruption.

    Example: semgp segment recording --model net.tflite --labels nyu13.toml --out recording/labels

    Example: semgp segment "photos/*.jpg" --model net.onnx --out labels

    Parameters
    ----------
    images
        An image, a folder of images, a pattern in quotes, or an RGB-D folder (7-Scenes, ScanNet, Open3D, TUM,
        NYU).
    model
        The network: a .tflite or .onnx file. What it does not say about itself stands in a TOML of the same name
        beside it, for example which pixel mean it was trained with.
    out
        The folder to write to.
    labels
        The classes of the map: a class file that says which of the network's classes each takes in (from), or a
        built-in remapping (ade20k-32-to-nyu13, nyu40-to-nyu13). Left out, the network's classes.
    classes
        The network's classes: a built-in list, a class file, or their number. Left out, those of the model's TOML,
        or else numbers.
    soft
        Write class probabilities beside the labels.
    overwrite
        Label images again that have labels in the folder.
    """
    require_place(model)

    from semgp.class_files import class_list, remapping
    from semgp.cli.console import counted, keeping, progress, report
    from semgp.segmentation import images_of, segmenter_of
    from semgp.segmentation.folder import segment_images, unlabelled

    segmenter = segmenter_of(
        model,
        None if classes is None else class_list(classes),
        None if labels is None else remapping(labels),
    )
    paths = [image for path in images for image in images_of(path)]
    left = unlabelled(paths, out)
    todo = paths if overwrite else left
    labelled: list[float] = []
    begin = time.perf_counter()
    with (
        progress() as bars,
        keeping(lambda: f"{out} has labels of {len(labelled)} more images; run it again to go on."),
    ):
        written = segment_images(todo, segmenter, out, soft=soft)
        for _, fraction in bars.track(written, total=len(todo), description="labelling images"):
            labelled.append(fraction)
    seconds = time.perf_counter() - begin
    share = sum(labelled) / len(labelled) if labelled else 0.0
    words = f"{out}: {counted(len(labelled), 'image')} labelled in {seconds:.1f} s"
    if labelled:
        words += f"; {share:.1%} of the pixels have one of {len(segmenter.classes)} classes"
    report(
        words + ("" if todo == paths else f"; {len(paths) - len(todo):,} were labelled already"),
        out=out,
        images=len(labelled),
        kept=len(paths) - len(todo),
        seconds=seconds,
        labelled_fraction=share,
        classes=segmenter.classes.names,
    )
