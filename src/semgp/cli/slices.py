"""`semgp slice`: horizontal slices of a map, to look at or to plan on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from semgp.cli.console import progress, report
from semgp.cli.places import require_place
from semgp.cli.space import spatial_map
from semgp.errors import FileFormatError, InputError

Pair = Annotated[tuple[float, float], Parameter(negative="")]


def slice_(
    map_file: Path,
    /,
    *,
    out: Path,
    heights: Pair | None = None,
    height: float | None = None,
    low: Pair | None = None,
    high: Pair | None = None,
    resolution: float | None = None,
    costs: Path | None = None,
) -> None:
    """Write a horizontal slice: a picture of classes and entropy, or .pgm and .yaml for ROS' map_server.

    Example: semgp slice floor.semgp --height 1.0 --out floor.png

    Example: semgp slice floor.semgp --heights 0.1 1.2 --resolution 0.05 --out floor.yaml

    Parameters
    ----------
    map_file
        A map; for a .yaml, one with free space: "semgp build --free-space", or an OctoMap. x, y and z below are
        those of a frame with z up, to which maps with another upward axis are turned.
    out
        The file to write: .png, or .yaml with the .pgm beside it.
    heights
        For a .yaml: from and to, metres; what is there between them is an obstacle.
    height
        For a .png: z in metres.
    low
        Corner of the slice, x and y in metres; left out, that of all that is mapped.
    high
        The corner across from it.
    resolution
        Edge of a cell in metres; left out, the map's for a .yaml, and what the picture shows for a .png.
    costs
        For a .yaml: a JSON file of costs from 0 to 100 by class name; cells then hold the cost of what they hold.
    """
    require_place(map_file)
    if out.suffix.lower() == ".png":
        if height is None or heights is not None or costs is not None:
            raise InputError("a .png shows the slice at one --height; --heights and --costs are for .yaml files.")
        _draw_slice(map_file, out, height, low, high, resolution)
    else:
        if heights is None or height is not None:
            raise InputError(f"{out}: give a .yaml file and --heights FROM TO, or a .png file and --height Z.")
        _write_grid(map_file, out, heights, low, high, resolution, costs)


def _draw_slice(
    map_file: Path, out: Path, height: float, low: Pair | None, high: Pair | None, resolution: float | None
) -> None:
    import numpy as np

    from semgp.maps.files import load_map
    from semgp.picture.image import save_png
    from semgp.planning.section import section

    with progress() as bars:
        bar = bars.add_task("asking the map", total=None)
        cut = section(
            load_map(map_file),
            height,
            low,
            high,
            resolution=resolution,
            progress=lambda n, total: bars.update(bar, completed=n, total=total),
        )
        save_png(out, cut.picture())
    rows, columns = cut.label.shape
    known = float(np.isfinite(cut.entropy).mean())
    words = f"{out}: {columns} x {rows} cells of {cut.resolution:.3g} m, {known:.0%} of them observed"
    report(words, out=out, columns=columns, rows=rows, resolution=cut.resolution, observed=known)


def _write_grid(
    map_file: Path,
    out: Path,
    heights: Pair,
    low: Pair | None,
    high: Pair | None,
    resolution: float | None,
    costs: Path | None,
) -> None:
    import numpy as np

    from semgp.planning import occupancy_grid
    from semgp.upward import level

    with progress() as bars:
        bars.add_task("asking the map", total=None)
        semantic_map = spatial_map(map_file)
        mapped = np.concatenate([semantic_map.occupied_positions, semantic_map.free_positions])
        mapped = (mapped @ level(semantic_map.up).T)[:, :2]
        if not len(mapped):
            raise InputError(
                f"{map_file} holds no free space and nothing occupied: build it from scans with a pose."
            )
        grid = occupancy_grid(
            semantic_map,
            mapped.min(axis=0) if low is None else low,
            mapped.max(axis=0) if high is None else high,
            heights=heights,
            resolution=semantic_map.resolution if resolution is None else resolution,
            costs=None if costs is None else _costs(costs),
        )
        grid.write(out)
    rows, columns = grid.data.shape
    known = float(np.mean(grid.data >= 0))
    words = f"{out}: {columns} x {rows} cells, {known:.0%} of them known"
    report(words, out=out, columns=columns, rows=rows, resolution=grid.resolution, known=known)


def _costs(path: Path) -> dict[str, int]:
    try:
        costs = json.loads(path.read_text())
        return {str(name): int(cost) for name, cost in costs.items()}
    except OSError as error:
        raise FileFormatError(path, f"cannot be read: {error.strerror or error}.") from error
    except (ValueError, TypeError, AttributeError) as error:
        raise FileFormatError(path, f"holds no costs by class name as JSON: {error}") from error
