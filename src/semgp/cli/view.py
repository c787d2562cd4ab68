"""`semgp view`: a map in the browser, live or as one self-contained page."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

from cyclopts import Parameter

from semgp.cli.console import progress, report
from semgp.cli.inputs import PLAIN, AnyInputs, Upward, sources
from semgp.cli.places import require_place
from semgp.errors import InputError

if TYPE_CHECKING:
    from semgp.cloud import LabelledCloud
    from semgp.maps.protocol import SemanticMap, SpatialMap
    from semgp.surfaces.mesh import Mesh
    from semgp.upward import Up
    from semgp.viewer.layers import Layer
    from semgp.viewer.playback import Playback

Flag = Annotated[bool, Parameter(negative="")]


def view(
    what: list[Path],
    /,
    *,
    html: Path | None = None,
    by: str = "class",
    hide: list[str] | None = None,
    resolution: float | None = None,
    up: Upward = None,
    title: str | None = None,
    cloud: Annotated[list[Path] | None, Parameter(consume_multiple=True)] = None,
    octomap: Path | None = None,
    mesh: Flag = False,
    play: Flag = False,
    model: str = "general",
    inputs: AnyInputs = PLAIN,
    points: int = 300_000,
    megabytes: float = 8.0,
    host: str = "127.0.0.1",
    port: int = 8080,
) -> None:
    """Show a map in the browser, or write it as one page that needs nothing else.

    Example: semgp view room.semgp

    Example: semgp view room.semgp --hide ceiling --cloud room.ply --octomap room-octomap.semgp

    Example: semgp view room.semgp --html room.html

    Example: semgp view sequences/08 --play --model outdoor-lidar

    Parameters
    ----------
    what
        A map that "semgp build" wrote; with --play, scans.
    html
        Write a page to this file instead of serving: it loads nothing, from nowhere, and opens anywhere.
    by
        What the colours show: class, confidence, entropy, variance, occupancy, or the name of a class for its
        probability. The viewer changes it.
    hide
        A class that is switched off at first, such as ceiling; may be given again.
    resolution
        Metres between the points that the map is asked at; left out, as its data are. The viewer changes it.
    up
        The axis of the map that points upwards; left out, what the map says.
    title
        Heading; left out, the name of the map.
    cloud
        Scans to show beside the map, as a layer.
    octomap
        A map of kind octomap to show beside the map, its occupied voxels as cubes.
    mesh
        Show the surface of maps with free space as a mesh, too.
    play
        Build a GP map from the scans in the browser, one by one.
    model
        The GP's model for --play: general, outdoor-lidar, indoor-rgbd or indoor-labels.
    points
        The most points that the viewer shows at once; finer resolutions than they allow are not shown.
    megabytes
        The page is not larger.
    host
        Where the viewer listens; 0.0.0.0 lets other machines in, without any password.
    port
        The port it listens at; 0 takes any that is free.
    """
    if not play and len(what) != 1:
        raise InputError("give one map; to see one built from scans, add --play.")
    require_place(*what)
    name, hidden = title or what[0].stem, hide or ()
    if html is not None:
        if play or cloud or octomap or mesh:
            raise InputError("a page shows the map alone: --html goes without --play, --cloud, --octomap, --mesh.")
        _write(what[0], html, name, round(1e6 * megabytes), by=by, hide=hidden, resolution=resolution, up=up)
        return
    from semgp.maps.files import load_map
    from semgp.viewer.live import LiveViewer

    with progress() as bars:
        bars.add_task("asking the map", total=None)
        source = _playback(what, inputs, model, up) if play else load_map(what[0])
        viewer = LiveViewer(
            source,
            title=name,
            host=host,
            port=port,
            resolution=resolution,
            field=by,
            hide=hidden,
            up=up,
            most=points,
            layers=_layers(source, sources(cloud, inputs) if cloud else (), octomap, points),
            mesh=_mesh(source) if mesh else None,
        )
    with viewer, contextlib.suppress(KeyboardInterrupt):
        report(f"open {viewer.url} in a browser; Ctrl-C ends it", url=viewer.url)
        sys.stdout.flush()
        while not threading.Event().wait(0.5):  # a signal that another thread has caught is seen here, too
            pass


def _write(
    map_file: Path,
    html: Path,
    title: str,
    most_bytes: int,
    *,
    by: str,
    hide: Sequence[str],
    resolution: float | None,
    up: Up | None,
) -> None:
    from semgp.maps.files import load_map
    from semgp.viewer.page import write_page

    with progress() as bars:
        asking = bars.add_task("asking the map", total=None)
        size = write_page(
            load_map(map_file),
            html,
            title=title,
            field=by,
            hide=hide,
            resolution=resolution,
            up=up,
            most_bytes=most_bytes,
            progress=lambda n, total: bars.update(asking, completed=n, total=total),
        )
    report(f"{html}: {size / 1e6:.1f} MB, opens in any browser", out=html, bytes=size)


def _layers(
    source: SemanticMap | Playback, clouds: Sequence[LabelledCloud], octomap: Path | None, most: int
) -> list[Layer]:
    """Return what is shown beside the map: free space where it has any, clouds and cubes where they are given."""
    from semgp.maps.files import load_map
    from semgp.viewer.layers import cloud_layer, free_layer, octomap_layer
    from semgp.viewer.playback import Playback
    from semgp.viewer.surface import Surface

    semantic_map = source.begin() if isinstance(source, Playback) else source
    spacing = Surface(semantic_map.positions).spacing
    free = None if isinstance(source, Playback) else free_layer(source, spacing / 4, most // 3)
    layers = [] if free is None else [free]
    if len(clouds):
        layers.append(cloud_layer(clouds, spacing / 2, most))
    if octomap is not None:
        layers.append(octomap_layer(load_map(octomap)))
    return layers


def _mesh(source: SemanticMap | Playback) -> Mesh:
    from semgp.surfaces import surface
    from semgp.viewer.playback import Playback
    from semgp.viewer.surface import Surface

    if isinstance(source, Playback):
        raise InputError("--mesh shows the surface of a finished map: leave it out with --play.")
    return surface(cast("SpatialMap", source), resolution=Surface(source.positions).spacing)


def _playback(scans: list[Path], inputs: AnyInputs, model: str, up: Up | None) -> Playback:
    from semgp.maps.gp import GPSemanticMap
    from semgp.maps.presets import PRESETS, with_vertical
    from semgp.upward import vertical
    from semgp.viewer.playback import Playback

    if model not in PRESETS:
        raise InputError(f"--model must be one of {', '.join(PRESETS)}, not {model!r}.")
    clouds = sources(scans, inputs)
    first = clouds[0]
    classes, upward = first.classes, up or first.up

    def begin() -> GPSemanticMap:
        made = GPSemanticMap(classes, with_vertical(PRESETS[model], vertical(upward)))
        made.up = upward
        return made

    return Playback(clouds, begin)
