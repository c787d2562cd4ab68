"""What tests of damaged and hostile files share."""

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semgp.errors import FileFormatError
from semgp.store import MapStore, StoredMap
from tests.store.scenes import (
    cloud,
)

Plain = dict[str, Any]

CLOUDS = cloud(0, n=60), cloud(1, 5.0, n=60)
FEW = CLOUDS[0].points[::3]


def use(store: MapStore) -> None:
    """Do all that reads."""
    made = StoredMap(store)
    made.info()
    len(made)
    made.query(FEW)
    made.load()


def assert_refused(store: MapStore, path: Path) -> FileFormatError:
    """Check that using a map fails, and that the file at fault is named."""
    with pytest.raises(FileFormatError) as caught:
        use(store)
    assert caught.value.path == path, str(caught.value)
    return caught.value


def failure(store: MapStore) -> FileFormatError | None:
    """Use a map, and return how that fails."""
    try:
        use(store)
    except FileFormatError as error:
        return error
    return None


def first_tile(store: MapStore) -> tuple[int, Path]:
    key, tile = sorted(store.manifest().tiles.items())[0]
    return key, Path(store.location) / "tiles" / tile.name(key)


def zipped(members: dict[str, bytes]) -> bytes:
    """A zip archive of .npy files of any content."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return file.getvalue()


def packed(arrays: Plain) -> bytes:
    """A tile file of any arrays."""
    members = {}
    for name, array in arrays.items():
        raw = io.BytesIO()
        np.lib.format.write_array(raw, np.asarray(array), allow_pickle=True)
        members[name] = raw.getvalue()
    return zipped(members)


def unpacked(data: bytes) -> Plain:
    with np.load(io.BytesIO(data)) as file:
        return dict(file)
