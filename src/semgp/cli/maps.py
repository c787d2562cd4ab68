"""`semgp query`, `evaluate` and `info`: what a map file holds and says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from semgp.cli.console import STDOUT, progress, score_table, write_json
from semgp.cli.options import JsonOut
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.evaluation.scores import score
from semgp.maps.files import load_map
from semgp.maps.protocol import SemanticMap
from semgp.maps.surface import surface_grid
from semgp.prediction import Prediction
from semgp.readers import open_scans
from semgp.writers import write_npz, write_ply

SCORES = ("points", "coverage", "auc", "accuracy", "miou", "nll", "brier", "ece")


def query(
    map_file: Path,
    /,
    *,
    out: Path,
    points: Path | None = None,
    resolution: float | None = None,
    quiet: bool = False,
) -> None:
    """Ask a map for class probabilities and uncertainty, and write them as points.

    Example: semgp query room.semgp --resolution 0.05 --out room-5cm.ply

    Parameters
    ----------
    map_file
        A map that `semgp build` wrote.
    out
        The file to write: .ply or .npz, with label, class colour, probabilities, entropy, variance and, from maps
        with free space, occupancy and state (1 occupied, 0 free, -1 unknown).
    points
        A point file: the query points.
    resolution
        Instead of points, the spacing in metres of a grid along the mapped surface.
    quiet
        Show no progress.
    """
    if (points is None) == (resolution is None):
        raise InputError("give either --points FILE or --resolution METRES.")
    if out.suffix not in (".ply", ".npz"):
        raise InputError(f"{out}: results are written as .ply or .npz.")
    semantic_map = load_map(map_file)
    if points is not None:
        X = np.concatenate([cloud.points for cloud in open_scans(points)])
    else:
        X = surface_grid(semantic_map.positions, resolution)
    with progress(quiet) as bars:
        bars.add_task(f"querying {len(X):,} points", total=None)
        prediction = semantic_map.query(X)
    write_prediction(out, X, prediction)
    seen = np.count_nonzero(prediction.observed)
    STDOUT.print(f"{out}: {len(X):,} points, {seen:,} of them observed")


def evaluate(map_file: Path, /, *, truth: Path, json: JsonOut = None) -> None:
    """Score a map against points with true labels.

    Example: semgp evaluate room.semgp --truth room-truth.ply

    Parameters
    ----------
    map_file
        A map that `semgp build` wrote.
    truth
        A point file or data set with true labels, of the map's classes.
    json
        Write the scores to this file, or to standard output with "-".
    """
    semantic_map = load_map(map_file)
    scans = list(open_scans(truth))
    names = semantic_map.classes.names
    if any(cloud.classes.names != names for cloud in scans):
        scans = [_renamed(cloud, semantic_map) for cloud in scans]
    X = np.concatenate([cloud.points for cloud in scans])
    labels = np.concatenate([cloud.hard_labels for cloud in scans])
    prediction = semantic_map.query(X)
    scores = score(prediction.probability, prediction.observed, labels)
    if str(json) != "-":
        row = {"points": scores.n_points, "auc": scores.auc_total} | {
            n: getattr(scores, n, None) for n in SCORES[3:]
        }
        STDOUT.print(score_table(f"{map_file} against {truth}", [row | {"coverage": scores.coverage}], SCORES))
    write_json(json, scores.to_json())


def info(map_file: Path, /, *, json: Annotated[bool, Parameter(negative="")] = False) -> None:
    """Show what a map file holds: kind, classes, model, counts, memory.

    Example: semgp info room.semgp

    Parameters
    ----------
    map_file
        A map that `semgp build` wrote.
    json
        As JSON.
    """
    facts = load_map(map_file).info()
    if json:
        write_json(Path("-"), facts)
        return
    for name, value in facts.items():
        STDOUT.print(f"[bold]{name.replace('_', ' ')}[/]: {value}")


def write_prediction(path: Path, points: np.ndarray, prediction: Prediction) -> None:
    """Write a prediction at points as .ply or .npz."""
    fields: dict[str, np.ndarray] = {"confidence": prediction.confidence, "entropy": prediction.entropy}
    if prediction.variance is not None:
        best = prediction.probability.argmax(axis=1)
        fields["variance"] = np.take_along_axis(prediction.variance, best[:, None], axis=1)[:, 0]
    if prediction.occupancy is not None:
        fields |= {"occupancy": prediction.occupancy.probability, "state": prediction.occupancy.state}
    classes, label = prediction.classes, prediction.label
    if path.suffix == ".npz":
        weights = prediction.probability.astype(np.float32)
        cloud = LabelledCloud(points, classes, weights=weights)
        write_npz(path, cloud, label=label, observed=prediction.observed, **fields)
        return
    from semgp.picture.colour import by_class

    write_ply(
        path,
        points,
        classes=classes,
        colours=by_class(label, classes),
        probability=prediction.probability,
        label=label,
        observed=prediction.observed.astype(np.uint8),
        **fields,
    )


def _renamed(cloud: LabelledCloud, semantic_map: SemanticMap) -> LabelledCloud:
    """Return a cloud that names no classes of its own with the map's."""
    if len(cloud.classes) > len(semantic_map.classes) or not cloud.classes.names[0].startswith("class 0"):
        raise InputError(
            f"the truth's classes ({', '.join(cloud.classes.names)}) are not the map's "
            f"({', '.join(semantic_map.classes.names)})."
        )
    return replace(cloud, classes=semantic_map.classes, labels=cloud.hard_labels, weights=None)
