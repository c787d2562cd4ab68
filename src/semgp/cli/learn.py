"""`semgp learn`: scans to the model of a map."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from semgp.cli.console import progress, report
from semgp.cli.inputs import PLAIN, AnyInputs, Upward, at_most, sources
from semgp.errors import FileFormatError, InputError
from semgp.upward import Up, vertical

if TYPE_CHECKING:
    from rich.progress import Progress

    from semgp.blocks.model import BlockModel
    from semgp.cloud import LabelledCloud
    from semgp.gp.model import GPModel

PAPER = "paper"
"""The name of the whole-scan GP among the models."""

LEAST_OVERLAP = 0.25
"""Share of places that both halves of the scans must see for a model to be learned from them."""

SAMPLE = (20, 5)
"""A block model is learned from so many scans at most, at most every so many apart."""


def learn(
    scans: list[Path],
    /,
    *,
    out: Path,
    inputs: AnyInputs = PLAIN,
    model: str = "outdoor-lidar",
    resolution: float | None = None,
    up: Upward = None,
    seed: int = 0,
) -> None:
    """Learn a block model from a sequence of labelled scans, and write it as JSON for "semgp build --model".

    Example: semgp learn sequences/08 --out drive.json

    Parameters
    ----------
    scans
        Point files or data-set folders: two scans of one place at least, in the order in which they were taken.
        Their labels may be wrong: they judge each other. Of long sequences, 20 scans from the middle are taken,
        five apart.
    out
        The model file to write.
    model
        Where to begin: general, indoor-rgbd, indoor-labels, outdoor-lidar, or a model file.
    resolution
        Edge in metres of the voxels in which labels are added up, instead of the model's.
    up
        The axis of the scans' world that points upwards; left out, what the scans say, as for "semgp build".
    seed
        Seed of every random draw.
    """
    clouds = sources(scans, inputs)

    from semgp.writers import atomic_write

    with progress() as bars:
        sample = list(at_most(clouds, *SAMPLE))
        up = up or sample[0].up
        learned = learn_blocks(sample, block_model(model, resolution, up), up, seed, bars)
    with atomic_write(out) as temporary:
        temporary.write_text(json.dumps(learned.to_json(), indent=2) + "\n")
    report(
        f"{out}: a model from {len(clouds)} scans; use it with semgp build --model {out}",
        out=out,
        scans=len(clouds),
    )


def block_model(name: str, resolution: float | None, up: Up) -> BlockModel:
    """Return a preset turned to the world's vertical axis, or the model in a file as it is."""
    from semgp.blocks.model import BlockModel
    from semgp.maps.presets import PRESETS, with_vertical

    if name in PRESETS:
        model = with_vertical(PRESETS[name], vertical(up))
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


def learn_blocks(
    sources: Sequence[LabelledCloud], model: BlockModel, up: Up, seed: int, bars: Progress
) -> BlockModel:
    """Return a model learned from scans, with progress.

    Raises
    ------
    InputError
        Scans of different places, which cannot judge each other.
    """
    from semgp.blocks.learning import learn_from_scans

    if (shared := overlap(sources, model.resolution)) < LEAST_OVERLAP:
        raise InputError(
            f"the scans see different places: of what one half of them sees, the other sees {shared:.0%}. They "
            "cannot judge each other's labels, so nothing can be learned. Use a model as it is: semgp build "
            "--no-learn."
        )
    bar = bars.add_task("learning the model", total=None)

    def show(n: int, loss: float) -> None:
        bars.update(bar, description=f"learning the model: {n} evaluations, log-loss {loss:.4f}")

    return learn_from_scans(sources, model, vertical=vertical(up), seed=seed, progress=show)[0]


def overlap(clouds: Sequence[LabelledCloud], resolution: float) -> float:
    """Return the share of places, four voxels wide, that every other scan sees of what the others see."""
    import numpy as np

    edge, labelled = 4 * resolution, [cloud.points[cloud.labelled] for cloud in clouds if cloud.labelled.any()]
    halves = [np.unique(np.floor(np.concatenate(h) / edge), axis=0) for h in (labelled[::2], labelled[1::2]) if h]
    if len(halves) < 2:
        return 1.0  # one scan: for others to refuse
    both = sum(map(len, halves)) - len(np.unique(np.concatenate(halves), axis=0))
    return both / max(min(map(len, halves)), 1)


def learn_paper(sources: Sequence[LabelledCloud], model: GPModel, iterations: int, bars: Progress) -> GPModel:
    """Return the paper's GP with hyperparameters learned from the first labelled scan."""
    from semgp.maps.learning import learn_model

    bar = bars.add_task("learning hyperparameters", total=None)
    first = next((cloud for cloud in sources if cloud.labelled.any()), sources[0])

    def show(n: int, nlml: float) -> None:
        bars.update(bar, description=f"learning hyperparameters: {n} evaluations, NLML {nlml:.1f}")

    return learn_model(first, model, max_iterations=iterations, progress=show)[0]
