"""What tests of the viewer look at."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL
from semgp.viewer.live import LiveViewer
from semgp.viewer.sample import Sample, take_sample
from semgp.viewer.surface import Surface

MODEL = replace(GENERAL, resolution=0.1)


@pytest.fixture
def gp_map(corner: LabelledCloud) -> GPSemanticMap:
    made = GPSemanticMap(corner.classes, MODEL, free=FreeSpace())
    made.update(corner)
    return made


@pytest.fixture(scope="module")
def plane() -> np.ndarray:
    """A floor of 2 m x 2 m, one datum every 10 cm."""
    x, y = np.meshgrid(np.arange(20) / 10 + 0.05, np.arange(20) / 10 + 0.05)
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(400)])


@pytest.fixture
def sample(gp_map: GPSemanticMap) -> Sample:
    return take_sample(gp_map, Surface.of(gp_map), 0.15, 100_000)


@pytest.fixture
def viewer(gp_map: GPSemanticMap) -> Iterator[LiveViewer]:
    with LiveViewer(gp_map, port=0, title="Corner") as live:
        assert live.wait(60)
        yield live
