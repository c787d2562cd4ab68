"""`semgp build` and `semgp update`: scans to a map, and more scans into it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.progress import Progress

from semgp.blocks.model import BlockModel
from semgp.cli.console import keeping, progress, report
from semgp.cli.inputs import PLAIN, AnyInputs, at_most, sources, tell_dropped
from semgp.cli.learn import PAPER, SAMPLE, Axis, block_model, learn_blocks, learn_paper
from semgp.errors import InputError
from semgp.executors import open_executor
from semgp.gp.model import GPModel
from semgp.maps.files import is_file_name, load_map, save_map
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.kinds import MAP_KINDS
from semgp.maps.presets import PRESETS
from semgp.maps.protocol import SerialisableMap
from semgp.readers import Scans
from semgp.store import BATCH, MapStore, Settings, StoredMap
from semgp.store import build as build_stored
from semgp.store.bucket import as_url

Kind = Literal["gp", "octomap", "knn", "csm", "bki"]
Workers = Annotated[Literal["threads", "ray"], Parameter(group="Many machines")]
Address = Annotated[str | None, Parameter(group="Many machines")]
Count = Annotated[int | None, Parameter(group="Many machines")]
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
    vertical: Axis = "z",
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
    vertical
        The axis of gravity in the scans' world.
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
    one_file = is_file_name(out)
    if one_file and (resume or executor != "threads"):
        raise InputError("--resume and --executor are for stores: give --out a name that does not end in .semgp.")
    if not one_file and (kind != "gp" or model == PAPER):
        raise InputError(
            f"{out}: only GP maps of many blocks are kept in stores: give --out a name.semgp instead."
        )
    clouds = sources(scans, inputs)
    if not one_file and MapStore(out).numbers():
        if not resume:
            raise InputError(
                f"{out} holds a map already: `semgp update` adds scans to it, --resume goes on with a build that "
                "was interrupted."
            )
        _update_store(out, clouds, executor, workers, address, resume=True)
        _drop_steps(out)
        return
    free = FreeSpace() if free_space or half_life is not None else None
    forgetting = None if half_life is None else Forgetting(half_life)
    with progress() as bars:
        semantic_map: SerialisableMap
        if kind != "gp":
            semantic_map = MAP_KINDS[kind](clouds[0].classes)  # type: ignore[call-arg]
        elif model == PAPER:
            start = GPModel(max_points=max_points, n_inducing=inducing, seed=seed)
            semantic_map = GPSemanticMap(
                clouds[0].classes, learn_paper(clouds, start, iterations, bars) if learn else start
            )
        else:
            blocks = _blocks(clouds, model, resolution, vertical, learn, seed, bars)
            if not one_file:
                MapStore(out).create(Settings(clouds[0].classes, blocks, free, forgetting), "begun")
            semantic_map = GPSemanticMap(clouds[0].classes, blocks, free=free, forgetting=forgetting)
        if one_file:
            _fill(semantic_map, clouds, bars)
    if not one_file:
        _update_store(out, clouds, executor, workers, address)
        _drop_steps(out)
        return
    tell_dropped(clouds)
    save_map(semantic_map, out)
    n = len(semantic_map)
    report(f"{out}: {kind} map of {n:,} elements from {len(clouds)} scans", out=out, kind=kind, elements=n)


def update(
    map_place: Path,
    /,
    scans: list[Path],
    *,
    inputs: AnyInputs = PLAIN,
    executor: Workers = "threads",
    workers: Count = None,
    address: Address = None,
) -> None:
    """Add labelled scans to a map.

    Example: semgp update drive sequences/09

    Parameters
    ----------
    map_place
        A map that "semgp build" wrote: a store, which gets new versions, or a file, which is replaced.
    scans
        As for "semgp build", of the map's classes and in its frame.
    executor
        Who does the work of a store: the threads of this process, or a Ray cluster.
    workers
        How many at a time; one for each core by default.
    address
        Address of a Ray cluster, "auto" for the one this machine belongs to; left out, one is started here.
    """
    clouds = sources(scans, inputs)
    semantic_map = load_map(map_place)
    if isinstance(semantic_map, StoredMap):
        _update_store(map_place, clouds, executor, workers, address)
        return
    if not isinstance(semantic_map, SerialisableMap):
        raise InputError(f"{map_place}: maps of the kind {semantic_map.kind} cannot be written.")
    if executor != "threads":
        raise InputError("--executor is for stores, and this map is one file.")
    with progress() as bars:
        _fill(semantic_map, clouds, bars)
    tell_dropped(clouds)
    save_map(semantic_map, map_place)
    n = len(semantic_map)
    report(f"{map_place}: {n:,} elements with {len(clouds)} scans more", out=map_place, elements=n)


def _blocks(
    clouds: Scans, model: str, resolution: float | None, vertical: Axis, learn: bool, seed: int, bars: Progress
) -> BlockModel:
    """The model of blocks, learned where it is to be."""
    blocks = block_model(model, resolution, vertical)
    if not learn or model not in PRESETS:
        return blocks
    labelled = [cloud for cloud in at_most(clouds, *SAMPLE) if cloud.labelled.any()]
    return learn_blocks(labelled, blocks, vertical, seed, bars) if len(labelled) > 1 else blocks


def _fill(semantic_map: SerialisableMap, clouds: Scans, bars: Progress) -> None:
    """Update a map in memory with all clouds."""
    for cloud in bars.track(clouds, description="building the map"):
        semantic_map.update(cloud)
    if not len(semantic_map):
        raise InputError("no scan has a label: nothing to build a map from.")
    if isinstance(semantic_map, GPSemanticMap):
        semantic_map.solve()


def _update_store(
    place: Path, clouds: Scans, executor: str, workers: int | None, address: str | None, *, resume: bool = False
) -> None:
    """Add clouds to a store, a version every few of them, and say what came of it."""
    store = MapStore(place)
    done = store.manifest().clouds if resume else 0
    left = clouds[done:]

    def kept() -> str:
        manifest = store.manifest()
        return f"{place} holds version {manifest.number} with {manifest.clouds} scans; --resume goes on from there"

    with keeping(kept), progress() as bars:
        bar = bars.add_task("building the map", total=len(clouds), completed=done)
        if store.manifest().settings.forgetting is None:
            with open_executor(executor, workers, address) as work:
                build_stored(store, left, work, steps=lambda n: bars.update(bar, advance=n))
        else:
            _update_in_order(store, left, bars)
    tell_dropped(clouds)
    manifest = store.manifest()
    if not manifest.sites:
        raise InputError(f"no scan has a label: {place} holds an empty map.")
    report(
        f"{place}: version {manifest.number}, {manifest.sites:,} sites from {manifest.clouds} scans in "
        f"{len(manifest.tiles)} tiles, {manifest.n_bytes / 1e6:.1f} MB",
        out=place, version=manifest.number, sites=manifest.sites, scans=manifest.clouds, bytes=manifest.n_bytes,
    )  # fmt: skip


def _drop_steps(out: Path) -> None:
    """Remove the versions on the way to a finished map, where nobody else can be at work on it."""
    if as_url(out) is None:
        with suppress(InputError):
            MapStore(out).prune(1)


def _update_in_order(store: MapStore, clouds: Scans, bars: Progress) -> None:
    """Add clouds one after the other, to a map that forgets."""
    with StoredMap(store) as stored:
        for i, cloud in enumerate(bars.track(clouds, description="building the map"), 1):
            stored.update(cloud)
            if i % BATCH == 0:
                stored.commit()
