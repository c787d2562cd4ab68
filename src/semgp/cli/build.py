"""`semgp build` and `semgp learn`: scans to a map, and scans to the model of one."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from rich.progress import Progress

from semgp.blocks.learning import learn_from_scans
from semgp.blocks.model import BlockModel
from semgp.cli.console import STDOUT, progress
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.gp.model import GPModel
from semgp.maps.files import save_map
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.kinds import MAP_KINDS
from semgp.maps.learning import learn_model
from semgp.maps.presets import PRESETS, with_vertical
from semgp.maps.protocol import SemanticMap
from semgp.readers import open_scans
from semgp.writers import atomic_write

Kind = Literal["gp", "octomap", "knn", "csm", "bki"]
Axis = Literal["x", "y", "z"]
PAPER = "paper"


def build(
    scans: list[Path],
    /,
    *,
    out: Path,
    kind: Kind = "gp",
    model: str = "general",
    resolution: float | None = None,
    vertical: Axis = "z",
    learn: bool = True,
    free_space: bool = False,
    half_life: float | None = None,
    max_points: int = 5000,
    inducing: int = 300,
    iterations: int = 30,
    seed: int = 0,
    quiet: bool = False,
) -> None:
    """Build a map from labelled scans and write it to a file.

    Example: semgp build room.ply --out room.semgp

    Example: semgp build sequences/08 --model outdoor-lidar --out drive.semgp

    Example: semgp build sequences/08 --model outdoor-lidar --half-life 30 --out drive.semgp

    Parameters
    ----------
    scans
        Point files (.ply, .pcd, .npz) or data-set folders; labels of -1 are missing.
    out
        The map file to write.
    kind
        The method: the Gaussian-process map, the semantic OctoMap, or a baseline.
    model
        The GP's model: general; outdoor-lidar or indoor-rgbd for labels of a network; indoor-labels for few labels
        that are right; a file that "semgp learn" wrote; or paper, the whole-scan GP of the paper.
    resolution
        Edge in metres of the voxels in which labels are added up, instead of the model's.
    vertical
        The axis of gravity in the scans' world.
    learn
        With two scans or more, learn the model from their labels, from the preset on; a model file is taken as it
        is. The paper's GP learns from the first scan.
    free_space
        The GP keeps free space, too, from the rays of scans with a pose: "semgp query" then says what is occupied,
        and "semgp surface" and "semgp slice" have something to work on.
    half_life
        Keep free space and forget: labels lose half their weight in so many scans, and what rays pass through is
        given up.
    max_points
        The paper's GP: at most so many labelled points, drawn at random, train it.
    inducing
        The paper's GP: inducing points.
    iterations
        The paper's GP: limit of learning steps.
    seed
        Seed of every random draw.
    quiet
        Show no progress.
    """
    if (free_space or half_life is not None) and (kind != "gp" or model == PAPER):
        raise InputError("--free-space and --half-life are for the GP map of many blocks: leave them out.")
    sources = _sources(scans)
    with progress(quiet) as bars:
        semantic_map: SemanticMap
        if kind != "gp":
            semantic_map = MAP_KINDS[kind](sources[0].classes)  # type: ignore[call-arg]
        elif model == PAPER:
            start = GPModel(max_points=max_points, n_inducing=inducing, seed=seed)
            paper = _learn_paper(sources, start, iterations, bars) if learn else start
            semantic_map = GPSemanticMap(sources[0].classes, paper)
        else:
            blocks = _block_model(model, resolution, vertical)
            labelled = [cloud for cloud in sources if cloud.labelled.any()]
            if learn and model in PRESETS and len(labelled) > 1:
                blocks = _learn_blocks(labelled, blocks, vertical, seed, bars)
            free = FreeSpace() if free_space or half_life is not None else None
            forgetting = None if half_life is None else Forgetting(half_life)
            semantic_map = GPSemanticMap(sources[0].classes, blocks, free=free, forgetting=forgetting)
        for cloud in bars.track(sources, description="building the map"):
            semantic_map.update(cloud)
        if not len(semantic_map):
            raise InputError("no scan has a label: nothing to build a map from.")
        if isinstance(semantic_map, GPSemanticMap):
            semantic_map.solve()
    save_map(semantic_map, out)
    STDOUT.print(f"{out}: {kind} map of {len(semantic_map):,} elements from {len(sources)} scans")


def learn(
    scans: list[Path],
    /,
    *,
    out: Path,
    model: str = "outdoor-lidar",
    resolution: float | None = None,
    vertical: Axis = "z",
    seed: int = 0,
    quiet: bool = False,
) -> None:
    """Learn a block model from a sequence of labelled scans, and write it as JSON for "semgp build --model".

    Example: semgp learn sequences/08 --out drive.json

    Parameters
    ----------
    scans
        Point files or data-set folders: two scans of one place at least, in the order in which they were taken.
        Their labels may be wrong: they judge each other.
    out
        The model file to write.
    model
        Where to begin: general, indoor-rgbd, indoor-labels, outdoor-lidar, or a model file.
    resolution
        Edge in metres of the voxels in which labels are added up, instead of the model's.
    vertical
        The axis of gravity in the scans' world.
    seed
        Seed of every random draw.
    quiet
        Show no progress.
    """
    sources = _sources(scans)
    with progress(quiet) as bars:
        learned = _learn_blocks(sources, _block_model(model, resolution, vertical), vertical, seed, bars)
    with atomic_write(out) as temporary:
        temporary.write_text(json.dumps(learned.to_json(), indent=2) + "\n")
    STDOUT.print(f"{out}: a model from {len(sources)} scans; use it with semgp build --model {out}")


def _sources(scans: Sequence[Path]) -> list[LabelledCloud]:
    if not scans:
        raise InputError("give at least one scan: a point file or a data-set folder.")
    return [cloud for path in scans for cloud in open_scans(path)]


def _block_model(name: str, resolution: float | None, vertical: Axis) -> BlockModel:
    """Return a preset turned to the world's vertical, or the model in a file as it is."""
    if name in PRESETS:
        model = with_vertical(PRESETS[name], "xyz".index(vertical))
    elif name.endswith(".json"):
        path = Path(name)
        try:
            model = BlockModel.from_json(json.loads(path.read_text()))
        except OSError as error:
            raise FileFormatError(path, f"cannot be read: {error.strerror or error}.") from error
        except (ValueError, InputError) as error:
            raise FileFormatError(path, f"is no model: {error}") from error
    else:
        raise InputError(f"--model must be one of {', '.join(PRESETS)}, {PAPER}, or a .json file, not {name!r}.")
    return model if resolution is None else replace(model, resolution=resolution)


def _learn_blocks(
    sources: Sequence[LabelledCloud], model: BlockModel, vertical: Axis, seed: int, bars: Progress
) -> BlockModel:
    bar = bars.add_task("learning the model", total=None)

    def show(n: int, loss: float) -> None:
        bars.update(bar, description=f"learning the model: {n} evaluations, log-loss {loss:.4f}")

    return learn_from_scans(sources, model, vertical="xyz".index(vertical), seed=seed, progress=show)[0]


def _learn_paper(sources: Sequence[LabelledCloud], model: GPModel, iterations: int, bars: Progress) -> GPModel:
    bar = bars.add_task("learning hyperparameters", total=None)
    first = next((cloud for cloud in sources if cloud.labelled.any()), sources[0])

    def show(n: int, nlml: float) -> None:
        bars.update(bar, description=f"learning hyperparameters: {n} evaluations, NLML {nlml:.1f}")

    return learn_model(first, model, max_iterations=iterations, progress=show)[0]
