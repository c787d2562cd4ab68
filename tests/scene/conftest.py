"""A synthetic room and a scan of it."""

import pytest

from semgp.scene import DepthCamera, SyntheticRoom, SyntheticScan, synthetic_room

SMALL = DepthCamera(160, 120)


@pytest.fixture(scope="module")
def room() -> SyntheticRoom:
    return synthetic_room(seed=3, camera=SMALL)


@pytest.fixture(scope="module")
def scan(room: SyntheticRoom) -> SyntheticScan:
    return room.scan(0)
