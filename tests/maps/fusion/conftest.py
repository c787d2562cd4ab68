"""Scans of a town that fused maps are made of."""

import pytest

from semgp.cloud import LabelledCloud
from semgp.scene.lidar import Lidar
from semgp.scene.town import SyntheticTown


@pytest.fixture(scope="module")
def scans() -> list[LabelledCloud]:
    town = SyntheticTown(lidar=Lidar(beams=16, columns=300))
    return [town.scan(4 * i).observed for i in range(4)]
