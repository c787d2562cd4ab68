"""Map files: any map as one npz file of plain arrays and a JSON header. Nothing in it is ever executed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from semgp.classes import Classes
from semgp.errors import FileFormatError, InputError
from semgp.maps.kinds import MAP_KINDS
from semgp.maps.protocol import SemanticMap, SerialisableMap
from semgp.readers.npz import read_arrays
from semgp.store import StoredMap
from semgp.store.bucket import as_url
from semgp.upward import vertical
from semgp.writers import atomic_write

FORMAT = "semgp-map"
VERSION = 1


def is_file_name(path: str | Path) -> bool:
    """Tell whether a name is that of a map file rather than of a store."""
    return Path(path).suffix == ".semgp"


def save_map(semantic_map: SerialisableMap, path: str | Path) -> None:
    """Write a map to a file, whole or not at all.

    Parameters
    ----------
    semantic_map : SerialisableMap
        Any map but a stored one, which is on disk already.
    path : str or Path
        The file, by custom `*.semgp`, replaced where it exists.
    """
    header, arrays = semantic_map.to_arrays()
    classes = semantic_map.classes
    described: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "kind": semantic_map.kind,
        "classes": {"names": classes.names, "colours": classes.colours},
        "up": semantic_map.up,
        "map": header,
    }
    text = np.frombuffer(json.dumps(described).encode(), dtype=np.uint8)
    members: dict[str, Any] = {"header": text} | {f"map.{name}": array for name, array in arrays.items()}
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **members)


def load_map(path: str | Path) -> SemanticMap:
    """Open a map: a file that `save_map` wrote, or a store, which is read as far as it is asked.

    Parameters
    ----------
    path : str or Path
        A file, the folder of a `StoredMap`, or its URL.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged, no map of semgp, or written by a newer version; InputError for a folder
        without a map.
    """
    if as_url(path) is not None or Path(path).is_dir():
        return StoredMap(path)
    path = Path(path)
    arrays = read_arrays(path)
    if "header" not in arrays:
        raise FileFormatError(path, "is no map of semgp: it has no header. `semgp build` writes maps.")
    try:
        described = json.loads(arrays["header"].tobytes())
        if described["format"] != FORMAT:
            raise FileFormatError(path, f"is no map of semgp: its format is {described['format']!r}.")
        if described["version"] > VERSION:
            raise FileFormatError(
                path, f"was written by a newer semgp (format {described['version']}): upgrade semgp to read it."
            )
        if described["kind"] not in MAP_KINDS:
            raise FileFormatError(path, f"holds a map of the unknown kind {described['kind']!r}.")
        plain = described["classes"]
        classes = Classes(tuple(plain["names"]), tuple(tuple(colour) for colour in plain["colours"]))
        parts = {name.removeprefix("map."): a for name, a in arrays.items() if name.startswith("map.")}
        made = MAP_KINDS[described["kind"]].from_arrays(classes, described["map"], parts)
        made.up = described.get("up", "z")
        vertical(made.up)
        return made
    except FileFormatError:
        raise
    except (InputError, ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        raise FileFormatError(path, f"is damaged: {type(error).__name__}: {error}") from error
