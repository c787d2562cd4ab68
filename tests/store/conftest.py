"""Stored maps to use and to spoil."""

import shutil
from pathlib import Path

import pytest

from semgp.store import MapStore, StoredMap
from tests.store.hostile import CLOUDS
from tests.store.scenes import (
    FORGETTING,
    PLAIN,
    cloud,
    stored,
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of two versions and some tiles, with all that a map can have."""
    folder = tmp_path_factory.mktemp("hostile") / "map"
    stored(folder, *CLOUDS, settings=FORGETTING)
    return folder


@pytest.fixture
def store(whole: Path, tmp_path: Path) -> MapStore:
    """A copy to spoil."""
    return MapStore(shutil.copytree(whole, tmp_path / "map"))


@pytest.fixture
def five(tmp_path: Path) -> MapStore:
    """A map of five versions: empty, and of one to four clouds."""
    made = StoredMap.create(tmp_path / "map", PLAIN, note="begun")
    for i in range(4):
        made.update(cloud(i, 3.0 * i))
        made.commit(f"cloud {i}")
    return MapStore(tmp_path / "map")


@pytest.fixture
def crowded(tmp_path: Path) -> MapStore:
    """A map of five versions: empty, and of one to four clouds at the same place; see `scenes.crowd`."""
    made = StoredMap.create(tmp_path / "map", PLAIN)
    for i in range(4):
        made.update(cloud(i, 1.0))
        made.commit()
    return MapStore(tmp_path / "map")
