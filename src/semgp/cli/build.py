"""`semgp build`: scans to a map."""

from __future__ import annotations

import warnings
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from semgp.cli.console import counted, progress, report
from semgp.cli.inputs import PLAIN, AnyInputs, Upward, at_most, sources, tell_labels
from semgp.cli.learn import LEAST_OVERLAP, PAPER, SAMPLE, block_model, learn_blocks, learn_paper, overlap
from semgp.cli.places import named, require_place
from semgp.cli.update import BUILDING, Address, Count, Workers, fill, update_store
from semgp.errors import InputError

if TYPE_CHECKING:
    from rich.progress import Progress

    from semgp.blocks.model import BlockModel
    from semgp.maps.protocol import SerialisableMap
    from semgp.readers import Scans
    from semgp.store import MapStore
    from semgp.upward import Up

Kind = Literal["gp", "octomap", "knn", "csm", "bki"]
PaperNumber = Annotated[int, Parameter(group="The paper's GP")]


def build(
    scans: list[Path],
    /,
    *,
    out: Path,
    inputs: AnyInputs = PLAIN,
    kind: Kind = "gp",
    model: str = "general",
    resolution: float | None = None,
    up: Upward = None,
    learn: bool = True,
    free_space: bool = False,
    half_life: float | None = None,
    resume: Annotated[bool, Parameter(negative="")] = False,
    executor: Workers = "threads",
    workers: Count = None,
    address: Address = None,
    max_points: PaperNumber = 5000,
    inducing: PaperNumber = 300,
    iterations: PaperNumber = 30,
    seed: int = 0,
) -> None:
    """Build a map from labelled scans, as one file or as a store that grows.

    Example: semgp build room.ply --out room.semgp

    Example: semgp build sequences/08 --model outdoor-lidar --out drive

    Example: semgp build sequences/08 --model outdoor-lidar --half-life 30 --out drive.semgp

    Example: semgp build sequences/08 --model outdoor-lidar --executor ray --out s3://maps/drive

    Parameters
    ----------
    scans
        Point files, RGB-D recordings, robot logs or data-set folders; labels of -1 are missing.
    out
        The map to write. A name that ends in .semgp is one file, written at the end. Any other is a store, which
        may be larger than memory: a folder, or a URL such as s3://bucket/drive. On the way it has a version every
        few scans, which stay whatever happens; in a folder, the last one then replaces them.
    kind
        The method: the Gaussian-process map, the semantic OctoMap, or a baseline.
    model
        The GP's model: general; outdoor-lidar or indoor-rgbd for labels of a network; indoor-labels for few labels
        that are right; a file that "semgp learn" wrote; or paper, the whole-scan GP of the paper.
    resolution
        Edge in metres of the voxels in which labels are added up, instead of the model's.
    up
        The axis of the scans' world that points upwards. Left out, what the scans say: z, but for RGB-D recordings
        the axis that their cameras hold upwards, often -y.
    learn
        With two scans or more, learn the model from their labels, from the preset on; a model file is taken as it
        is. Of long sequences, 20 scans from the middle teach it, five apart. The paper's GP learns from the first
        scan.
    free_space
        The GP keeps free space, too, from the rays of scans with a pose: "semgp query" then says what is occupied,
        and "semgp surface" and "semgp slice" have something to work on.
    half_life
        Keep free space and forget: labels lose half their weight in so many scans, and what rays pass through is
        given up.
    resume
        Go on with a store whose build was interrupted: with the scan after the last one that it holds.
    executor
        Who does the work of a store: the threads of this process, or a Ray cluster.
    workers
        How many at a time; one for each core by default.
    address
        Address of a Ray cluster, "auto" for the one this machine belongs to; left out, one is started here.
    max_points
        At most so many labelled points, drawn at random, train it.
    inducing
        Inducing points.
    iterations
        Limit of learning steps.
    seed
        Seed of every random draw.
    """
    if (free_space or half_life is not None) and (kind != "gp" or model == PAPER):
        raise InputError("--free-space and --half-life are for the GP map of many blocks: leave them out.")
    require_place(*scans)

    from semgp.cli.describe import elements
    from semgp.gp.model import GPModel
    from semgp.maps.files import is_file_name, save_map
    from semgp.maps.forgetting import Forgetting
    from semgp.maps.free_space import FreeSpace
    from semgp.maps.gp import GPSemanticMap
    from semgp.maps.kinds import MAP_KINDS
    from semgp.store import MapStore, Settings

    one_file = is_file_name(out)
    if one_file and (resume or executor != "threads"):
        raise InputError("--resume and --executor are for stores: give --out a name that does not end in .semgp.")
    if not one_file and (kind != "gp" or model == PAPER):
        raise InputError(
            f"{named(out)}: only GP maps of many blocks are kept in stores: give --out a name.semgp instead."
        )
    clouds = sources(scans, inputs)
    if not one_file and (done := _clouds_taken(MapStore(out), resume)) is not None:
        update_store(out, clouds, executor, workers, address, done=done)
        return
    free = FreeSpace() if free_space or half_life is not None else None
    forgetting = None if half_life is None else Forgetting(half_life)
    first = clouds[0]
    classes, up = first.classes, up or first.up
    with progress() as bars:
        semantic_map: SerialisableMap
        if kind != "gp":
            semantic_map = MAP_KINDS[kind](classes)  # type: ignore[call-arg]
        elif model == PAPER:
            start = GPModel(max_points=max_points, n_inducing=inducing, seed=seed)
            paper = learn_paper(clouds, start, iterations, bars) if learn else start
            semantic_map = GPSemanticMap(classes, paper)
        else:
            blocks = _blocks(clouds, model, resolution, up, learn, seed, bars)
            semantic_map = GPSemanticMap(classes, blocks, free=free, forgetting=forgetting)
        semantic_map.up = up
        if one_file:
            fill(semantic_map, clouds, bars)
    if not one_file:
        MapStore(out).create(Settings(classes, blocks, free, forgetting, up=up), BUILDING)
        update_store(out, clouds, executor, workers, address, done=0)
        _drop_steps(out)
        return
    tell_labels(clouds)
    save_map(semantic_map, out)
    words = f"{out}: {kind} map of {elements(semantic_map)} from {counted(len(clouds), 'scan')}"
    report(words, out=out, kind=kind, elements=len(semantic_map))


def _clouds_taken(store: MapStore, resume: bool) -> int | None:
    """How many clouds a build that was interrupted has taken in; None where there is no map yet."""
    if not store.numbers():
        return None
    if not resume:
        raise InputError(
            f"{store.location} holds a map already: `semgp update` adds scans to it, --resume goes on with a "
            "build that was interrupted."
        )
    manifest = store.manifest()
    if manifest.note != BUILDING:
        raise InputError(
            f"{store.location} has been changed since it was built: add scans to it with `semgp update`."
        )
    return manifest.clouds


def _blocks(
    clouds: Scans, model: str, resolution: float | None, up: Up, learn: bool, seed: int, bars: Progress
) -> BlockModel:
    """The model of blocks, learned where it is to be."""
    from semgp.maps.presets import PRESETS

    blocks = block_model(model, resolution, up)
    if not learn or model not in PRESETS:
        return blocks
    labelled = [cloud for cloud in at_most(clouds, *SAMPLE) if cloud.labelled.any()]
    if len(labelled) < 2:
        return blocks
    if (shared := overlap(labelled, blocks.resolution)) < LEAST_OVERLAP:
        warnings.warn(
            f"the scans see different places (one half of them {shared:.0%} of what the other sees), so that "
            f"nothing can be learned from them: the model is {model} as it is.",
            stacklevel=2,
        )
        return blocks
    return learn_blocks(labelled, blocks, up, seed, bars)


def _drop_steps(out: Path) -> None:
    """Remove the versions on the way to a finished map, where nobody else can be at work on it."""
    from semgp.store import MapStore
    from semgp.store.bucket import as_url

    if as_url(out) is None:
        with suppress(InputError):
            MapStore(out).prune(1)
