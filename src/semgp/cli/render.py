"""`semgp render`: pictures of a map, still or moving."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from semgp.cli.inputs import PLAIN, AnyInputs, Upward, sources
from semgp.cli.places import require_place
from semgp.errors import InputError

Flag = Annotated[bool, Parameter(negative="", show_default=False)]


def render(
    map_file: Path,
    /,
    *,
    out: Path,
    by: str = "class",
    cloud: Annotated[list[Path] | None, Parameter(consume_multiple=True)] = None,
    inputs: AnyInputs = PLAIN,
    resolution: float | None = None,
    size: tuple[int, int] = (1200, 800),
    up: Upward = None,
    azimuth: float | None = None,
    elevation: float = 35.0,
    zoom: float = 1.0,
    top: Flag = False,
    cut: float | None = None,
    title: str | None = None,
    keys: bool = True,
    dark: Flag = False,
    orbit: Flag = False,
    frames: int = 48,
    rate: float = 12.0,
) -> None:
    """Draw a map as a picture or, with --orbit, as an animation that goes round it.

    Example: semgp render room.semgp --out room.png

    Example: semgp render drive.semgp --by class,entropy,car --elevation 50 --out drive.png

    Example: semgp render room.semgp --cut 2.4 --orbit --size 640 480 --out room.webp

    Parameters
    ----------
    map_file
        A map that "semgp build" wrote.
    out
        The file to write: .png, or with --orbit .gif, .webp or .png.
    by
        What the colours show, with commas between for pictures beside each other: class, confidence, entropy,
        variance, the name of a class for its probability, or rgb for the colours of --cloud.
    cloud
        Scans whose labels are shown first, beside the map; read as "semgp build" reads them.
    inputs
        How these scans are read.
    resolution
        Metres between the points that the map is asked at; left out, as many as the picture shows.
    size
        Width and height of each picture in pixels.
    up
        The axis of the map that points upwards; left out, what the map says.
    azimuth
        The side that the eye is on, in degrees about the upward axis: with z up, 0 is +x and 90 is +y. Left out,
        that from which most is seen.
    elevation
        Height of the eye in degrees, from -90 to 90.
    zoom
        Enlarge the middle.
    top
        Look from straight above, x to the right.
    cut
        Leave out what is higher than so many metres along the upward axis, such as a ceiling.
    title
        Written above the picture.
    keys
        Show legend, colour bars and scale bar.
    dark
        Light on dark.
    orbit
        Go round the map once.
    frames
        Pictures of the turn.
    rate
        Pictures a second.
    """
    require_place(map_file, *(cloud or ()))

    from semgp.cli.console import progress, report
    from semgp.maps.batches import query_in_batches
    from semgp.maps.files import load_map
    from semgp.picture.animation import require_animation, save_animation
    from semgp.picture.camera import TOP, Camera, below
    from semgp.picture.coverage import picture_resolution, surface_points
    from semgp.picture.image import Picture, require_png, save_png
    from semgp.picture.paint import require_colours
    from semgp.picture.portrait import cloud_layers, map_layers, portrait
    from semgp.picture.splat import DARK, WHITE
    from semgp.picture.view import View
    from semgp.upward import direction

    (require_animation if orbit else require_png)(out)
    if not all(16 <= pixels <= 16_384 for pixels in size):
        raise InputError(f"a picture has 16 to 16,384 pixels along each side, not {size[0]} x {size[1]}.")
    ground = DARK if dark else WHITE
    names = [name.strip() for name in by.split(",")]
    with progress() as bars:
        semantic_map = load_map(map_file)
        upward = direction(up or semantic_map.up)
        camera = Camera(azimuth, TOP if top else elevation, zoom, upward)
        require_colours(semantic_map.classes, [name for name in names if name != "rgb"])
        positions = below(semantic_map.positions, cut, upward)
        edge = picture_resolution(positions, max(size)) if resolution is None else resolution
        points = surface_points(positions, edge)
        asking = bars.add_task("asking the map", total=len(points))
        prediction = query_in_batches(semantic_map, points, lambda n, _: bars.update(asking, completed=n))
        scans = list(bars.track(sources(cloud, inputs), description="reading scans")) if cloud else []
        layers = cloud_layers(scans, names, cut, upward) + map_layers(points, edge, prediction, names)

        def draw(view: View) -> Picture:
            return portrait(layers, view, title=title, keys=keys, scale_bar=keys, background=ground)

        if orbit:
            turn = map(draw, camera.orbit(points, *size, frames))
            save_animation(out, bars.track(turn, total=frames, description="drawing"), rate=rate)
        else:
            save_png(out, draw(camera.view(points, *size)))
    report(f"{out}: {len(points):,} points {edge:.3g} m apart", out=out, points=len(points), resolution=edge)
