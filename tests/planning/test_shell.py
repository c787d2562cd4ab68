"""The shell against all distances: nothing near a surface is left out, and nothing far from one comes in."""

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.planning.shell import next_samples, shell_around

F64 = NDArray[np.float64]
STEP, N_STEPS, REACH = 0.1, 80, 0.2


def rays(seed: int, offset: float) -> tuple[F64, F64, F64]:
    """Positions on a bumpy ground and a pole, and rays from above it in all directions, some along the axes."""
    rng = np.random.default_rng(seed)
    ground = np.column_stack([rng.uniform(0, 6, (300, 2)), rng.normal(0, 0.1, 300)])
    pole = np.column_stack([np.full((20, 2), 3.0), np.linspace(0, 2, 20)])
    directions = np.vstack([rng.normal(size=(150, 3)), np.eye(3), -np.eye(3)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = rng.uniform((-1, -1, 0), (7, 7, 2), directions.shape)
    return np.vstack([ground, pole]) + offset, origins + offset, directions


@pytest.mark.parametrize("offset", [0.0, 5e6])
@pytest.mark.parametrize("seed", [0, 1])
def test_samples_near_positions_are_found_and_others_are_not(seed: int, offset: float) -> None:
    positions, origins, directions = rays(seed, offset)
    shell = shell_around(positions, REACH)
    following = np.zeros(len(origins), dtype=np.int64)
    found = next_samples(origins, directions, N_STEPS, STEP, shell, following, N_STEPS + 1)
    n_near = 0
    for o, d, row in zip(origins, directions, found):
        samples = o + np.arange(N_STEPS + 1)[:, None] * STEP * d
        away = np.abs(samples[:, None] - positions).max(axis=2).min(axis=1)
        given = row[row >= 0]
        assert (np.diff(given) > 0).all()
        assert set(np.flatnonzero(away < REACH - 1e-8)) <= set(given)
        assert (away[given] < 3 * REACH).all()
        n_near += (away < REACH).sum()
    assert 100 < n_near <= (found >= 0).sum() < 3 * n_near


def test_samples_come_in_portions() -> None:
    positions, origins, directions = rays(0, 0.0)
    shell = shell_around(positions, REACH)
    following = np.zeros(len(origins), dtype=np.int64)
    whole = next_samples(origins, directions, N_STEPS, STEP, shell, following.copy(), N_STEPS + 1)
    portions = [next_samples(origins, directions, N_STEPS, STEP, shell, following, 7) for _ in range(12)]
    for all_at_once, in_portions in zip(whole, np.concatenate(portions, axis=1)):
        assert all_at_once[all_at_once >= 0].tolist() == in_portions[in_portions >= 0].tolist()
