"""Maps in words: what `semgp info` says of any kind of map."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.blocks.model import BlockModel
from semgp.cli.console import counted
from semgp.cli.models import model_rows
from semgp.maps.abilities import as_spatial, resolution_of
from semgp.maps.gp import GPSemanticMap
from semgp.maps.protocol import SemanticMap, SerialisableMap
from semgp.store import StoredMap
from semgp.voxels import voxel_indices

KINDS = {
    "gp": "Gaussian-process map of one training set, the paper's",
    "octomap": "semantic OctoMap",
    "knn": "k-nearest-neighbour map",
    "csm": "counted labels in voxels (S-CSM)",
    "bki": "Bayesian kernel inference in voxels (S-BKI)",
}
ELEMENTS = {"sites": "site", "labelled_points": "labelled point", "voxels": "voxel", "points": "point"}
"""What maps are made of: the name of the count in their facts, and the word for one."""
SETTINGS = {
    "k": "{} nearest points",
    "kernel": "kernel {}",
    "width": "width {:g} m",
    "max_distance": "none beyond {:g} m",
    "ell": "kernel of radius {:g} m",
    "sigma0": "kernel of height {:g}",
    "alpha0": "prior count {:g} a class",
    "max_range": "rays of at most {:g} m",
}
"""Settings of the rivals, where they are set."""

Row = tuple[str, str]


def kind_of(semantic_map: SemanticMap) -> str:
    """Return in words what kind of map it is."""
    blocks = isinstance(getattr(semantic_map, "model", None), BlockModel)
    words = "Gaussian-process map of many blocks" if blocks else KINDS[semantic_map.kind]
    return f"{words}, stored in tiles" if isinstance(semantic_map, StoredMap) else words


def elements(semantic_map: SemanticMap) -> str:
    """Return how many of what a map is made of: 6,322 sites, 1,200 voxels, 1 labelled point."""
    return _elements(semantic_map, semantic_map.info())


def _elements(semantic_map: SemanticMap, facts: Mapping[str, Any]) -> str:
    return counted(len(semantic_map), next(word for name, word in ELEMENTS.items() if name in facts))


def rows_of(semantic_map: SemanticMap, facts: Mapping[str, Any], place: Path) -> Iterator[Row]:
    """Yield what there is to say, each line with its heading, given what the map's `info` returned."""
    yield "classes", _classes(semantic_map)
    yield "extent", _extent(semantic_map)
    yield "up", f"{semantic_map.up} axis"
    resolution = resolution_of(semantic_map) or facts.get("resolution")
    yield (
        "data",
        _elements(semantic_map, facts) + ("" if resolution is None else f" of {resolution:g} m") + _more(facts),
    )
    yield "free space", "no" if as_spatial(semantic_map) is None else _free_space(facts)
    if (forgetting := _forgetting(semantic_map)) is not None:
        yield "forgets", f"half of what it saw in {forgetting.half_life:g} {forgetting.per}s"
    yield from _size(facts, place)
    if isinstance(semantic_map, GPSemanticMap | StoredMap):
        yield from model_rows(semantic_map.model, semantic_map.classes)
    settings = [SETTINGS[name].format(facts[name]) for name in SETTINGS if facts.get(name)]
    if settings:
        yield "settings", "; ".join(settings)


def _classes(semantic_map: SemanticMap) -> str:
    """The classes, the most frequent first where that is known."""
    names, share = semantic_map.classes.names, label_shares(semantic_map)
    if share is None:
        return f"{len(names)}: {', '.join(names)}"
    order = np.argsort(-share, kind="stable")
    seen = ", ".join(f"{names[c]} {share[c]:.1%}" for c in order if share[c] > 0)
    unseen = ", ".join(names[c] for c in order if share[c] == 0)
    words = f"{len(names)}, by their share of the labels: {seen}"
    return f"{words}; without labels: {unseen}" if unseen else words


def label_shares(semantic_map: SemanticMap) -> NDArray[np.float64] | None:
    """Return each class's share (C,) of the labels in a map, None where tiles would have to be read."""
    if not isinstance(semantic_map, SerialisableMap):
        return None
    _, arrays = semantic_map.to_arrays()
    n_classes = len(semantic_map.classes)
    if "class" in arrays:  # the OctoMap lists the classes that each voxel has met
        mass = np.bincount(arrays["class"], weights=arrays["mass"], minlength=n_classes)
    elif "votes" in arrays:
        mass = np.bincount(arrays["vote_of"], minlength=len(arrays["votes"])) @ arrays["votes"]
    else:
        mass = arrays["mass" if "mass" in arrays else "weights"].sum(axis=0, dtype=np.float64)
    return np.asarray(mass / mass.sum()) if mass.any() else None


def _extent(semantic_map: SemanticMap) -> str:
    corners = _tile_corners(semantic_map) if isinstance(semantic_map, StoredMap) else semantic_map.positions
    if not len(corners):
        return "no data yet"
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = " x ".join(f"{edge:.2f}" for edge in high - low)
    ends = " to ".join(f"({', '.join(f'{v:.2f}' for v in corner)})" for corner in (low, high))
    return f"{size} m, from {ends}" + (", in whole tiles" if isinstance(semantic_map, StoredMap) else "")


def _tile_corners(stored: StoredMap) -> NDArray[np.float64]:
    """The lowest and highest corners of all tiles, which are not read."""
    manifest, settings = stored.store.manifest(stored.version), stored.settings
    if manifest.origin is None:
        return np.empty((0, 3))
    lowest = voxel_indices(np.array(sorted(manifest.tiles), dtype=np.int64), manifest.origin)
    return np.concatenate([lowest, lowest + (1 << settings.tiling.bits)]) * settings.resolution


def _more(facts: Mapping[str, Any]) -> str:
    """What else there is to say of the data."""
    words = []
    if "labelled_voxels" in facts:
        words.append(f"{facts['labelled_voxels']:,} of them labelled")
    if "training_points" in facts:
        words.append(f"{facts['training_points']:,} of them the training set")
    if "clouds" in facts:
        words.append(f"from {counted(facts['clouds'], 'scan')}")
    return "".join(f", {part}" for part in words)


def _free_space(facts: Mapping[str, Any]) -> str:
    return f"yes, {counted(facts['free_sites'], 'site')} more" if "free_sites" in facts else "yes"


def _forgetting(semantic_map: SemanticMap) -> Any:
    if isinstance(semantic_map, StoredMap):
        return semantic_map.settings.forgetting
    blocks = semantic_map.many_blocks if isinstance(semantic_map, GPSemanticMap) else None
    return None if blocks is None else blocks.forgetting


def _size(facts: Mapping[str, Any], place: Path) -> Iterator[Row]:
    """Memory and disk; of a store, its version too."""
    if "version" not in facts:
        memory = sum(facts.get(name, 0) for name in ("memory_bytes", "free_memory_bytes"))
        yield "size", f"{_bytes(memory)} in memory, {_bytes(place.stat().st_size)} on disk"
        return
    tiles = f"{counted(facts['tiles'], 'tile')} of {facts['tile_metres']:g} m"
    yield "size", f"{_bytes(facts['bytes_on_disk'])} on disk in {tiles}"
    note = f": {facts['note']}" if facts["note"] else ""
    yield "version", f"{facts['version']}, written {facts['time'][:16].replace('T', ' ')} UTC{note}"
    yield "kept", counted(facts["versions"], "version")


def _bytes(n: int) -> str:
    return f"{n / 1e3:,.0f} kB" if n < 1e6 else f"{n / 1e6:,.1f} MB"
