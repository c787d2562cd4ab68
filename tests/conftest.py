"""Fixtures that all tests share."""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from semgp.classes import Classes
from semgp.cloud import LabelledCloud


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the real data: $SEMGP_DATA, or shared/data beside the checkout; skips where it is absent."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("SEMGP_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"real data not found in {folder}; set SEMGP_DATA to its folder")
    return folder


@pytest.fixture(scope="session", autouse=True)
def _one_blas_thread() -> Iterator[None]:
    """Small matrices and busy machines: more BLAS threads only get in each other's way."""
    with threadpool_limits(1, "blas"):
        yield


THREE = Classes(("floor", "wall", "table"))


@pytest.fixture
def corner() -> LabelledCloud:
    """A floor and a wall that meet, a table top between, one label in three missing."""
    rng = np.random.default_rng(0)
    floor = np.column_stack([rng.uniform(0, 2, (150, 2)), np.zeros(150)])
    wall = np.column_stack([rng.uniform(0, 2, 150), np.full(150, 2.0), rng.uniform(0, 2, 150)])
    table = np.column_stack([rng.uniform(0.5, 1.5, (60, 2)), np.full(60, 0.8)])
    points = np.vstack([floor, wall, table]) + rng.normal(scale=0.005, size=(360, 3))
    labels = np.repeat([0, 1, 2], [150, 150, 60])
    labels[rng.random(360) < 1 / 3] = -1
    T_world_sensor = np.eye(4)
    T_world_sensor[:3, 3] = (1.0, -1.0, 1.2)
    return LabelledCloud(points, THREE, labels, colours=np.full((360, 3), 90), T_world_sensor=T_world_sensor)
