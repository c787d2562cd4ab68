"""`semgp crop` and `semgp fuse`: maps cut, and maps joined."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from semgp.cli.console import progress, report
from semgp.cli.places import named, require_place
from semgp.errors import FileFormatError, InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from semgp.maps.gp import GPSemanticMap
    from semgp.store import StoredMap

Corner = tuple[float, float, float]


def crop(map_place: Path, /, *, low: Corner, high: Corner, out: Path) -> None:
    """Cut a box out of a map; of a store, only its tiles in the box are read.

    Example: semgp crop drive --low 0 -20 -5 --high 60 20 5 --out crossing.semgp

    Parameters
    ----------
    map_place
        A GP map that "semgp build" wrote: a file, or a store.
    low
        The corner of least x, y and z, in metres.
    high
        The corner of greatest x, y and z, in metres.
    out
        The map to write: one file if its name ends in .semgp, else a store.
    """
    require_place(map_place)
    whole = _gp_map(map_place)
    with progress() as bars:
        bars.add_task("cutting", total=None)
        part = whole.crop(low, high)
        if not part.positions.size:
            raise InputError(f"{map_place} has no data between {low} and {high}: see its extent in `semgp info`.")
        _save(part, out, f"cut out of {named(map_place)}")
    report(f"{named(out)}: {len(part):,} sites", out=named(out), sites=len(part))


def fuse(
    map_place: Path,
    other: Path,
    /,
    *,
    out: Path,
    transform: Path | None = None,
    model: Literal["first", "second"] | None = None,
) -> None:
    """Join two maps that were built apart into one of all that both have seen.

    Example: semgp fuse robot-1.semgp robot-2.semgp --out both.semgp

    Example: semgp fuse robot-1 robot-2 --out both

    Parameters
    ----------
    map_place
        A GP map that "semgp build" wrote; its frame is that of the result.
    other
        Another one of the same classes and model.
    out
        The map to write: one file if its name ends in .semgp, else a store. Two stores become a store tile by
        tile, however large they are.
    transform
        A text file with the 4 x 4 matrix that takes the other map's frame to the first one's; left out, they share
        a frame.
    model
        Where each map has learned a model of its own: whose the result is to have. Better is one model for both,
        learned from the scans of both: "semgp learn A B --out model.json", "semgp build A --model model.json".
    """
    require_place(map_place, other)

    from semgp.blocks.model import BlockModel
    from semgp.maps.files import is_file_name
    from semgp.maps.fusion import fuse as fuse_maps
    from semgp.store import StoredMap, fuse_stored

    a, b = (_gp_map(path) for path in (map_place, other))
    if a.model != b.model and model is None:
        raise InputError(
            f"{map_place} and {other} have learned models of their own. Say which one the result is to have with "
            "--model first or second. Better is one for both: `semgp learn A B --out model.json`, then `semgp "
            "build A --model model.json`, and B likewise."
        )
    chosen = (b if model == "second" else a).model
    T_a_b = None if transform is None else _matrix(transform)
    with progress() as bars:
        bars.add_task("joining the maps", total=None)
        stored = isinstance(a, StoredMap) and isinstance(b, StoredMap) and not is_file_name(out)
        if stored and isinstance(a, StoredMap) and isinstance(b, StoredMap) and a.model == b.model:
            sites = fuse_stored(a, b, out, T_a_b, note=f"{named(map_place)} and {named(other)}").sites
        else:
            whose = chosen if a.model != b.model and isinstance(chosen, BlockModel) else None
            joined = fuse_maps(_loaded(a), _loaded(b), T_a_b, model=whose)
            _save(joined, out, f"{named(map_place)} and {named(other)}")
            sites = len(joined)
    report(f"{named(out)}: {sites:,} sites from {len(a):,} and {len(b):,}", out=named(out), sites=sites)


def _loaded(semantic_map: GPSemanticMap | StoredMap) -> GPSemanticMap:
    from semgp.store import StoredMap

    return semantic_map.load() if isinstance(semantic_map, StoredMap) else semantic_map


def _save(semantic_map: GPSemanticMap, out: Path, note: str) -> None:
    from semgp.maps.files import is_file_name, save_map
    from semgp.store import save

    if is_file_name(out):
        save_map(semantic_map, out)
    else:
        save(semantic_map, out, note=note)


def _gp_map(place: Path) -> GPSemanticMap | StoredMap:
    from semgp.maps.files import load_map
    from semgp.maps.gp import GPSemanticMap
    from semgp.store import StoredMap

    semantic_map = load_map(place)
    if not isinstance(semantic_map, GPSemanticMap | StoredMap):
        raise InputError(f"{place} holds a map of the kind {semantic_map.kind}: only GP maps are cut and joined.")
    return semantic_map


def _matrix(path: Path) -> NDArray[np.float64]:
    import numpy as np

    from semgp.checks import rigid_transform

    try:
        return rigid_transform(str(path), np.loadtxt(path))
    except OSError as error:
        raise FileFormatError(path, f"cannot be read: {error.strerror or error}.") from error
    except ValueError as error:
        raise FileFormatError(path, f"is no 4 x 4 matrix in text: {error}") from error
