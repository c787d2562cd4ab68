"""Clouds moved, and displaced by wrong poses."""

from dataclasses import replace

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.evaluation.displaced import displaced, moved


def test_points_stay_where_they_are_for_the_sensor(corner: LabelledCloud) -> None:
    for cloud in (displaced(corner, 0.3, 5.0, np.random.default_rng(0)), moved(corner, np.eye(4))):
        seen = []
        for c in (corner, cloud):
            assert c.T_world_sensor is not None
            seen.append((c.points - c.T_world_sensor[:3, 3]) @ c.T_world_sensor[:3, :3])
        np.testing.assert_allclose(seen[0], seen[1], atol=1e-9)


def test_errors_have_the_covariance_that_is_told(corner: LabelledCloud) -> None:
    rng = np.random.default_rng(0)
    drawn = [displaced(corner[:1], 0.1, 1.0, rng) for _ in range(4000)]
    told = drawn[0].position_covariances
    assert told is not None
    found = np.cov(np.concatenate([c.points for c in drawn]).T)
    np.testing.assert_allclose(found, told[0], atol=0.1 * np.trace(told[0]))


def test_bad_input(corner: LabelledCloud) -> None:
    with pytest.raises(InputError, match="T_world_sensor"):
        displaced(replace(corner, T_world_sensor=None), 0.1, 1.0, np.random.default_rng(0))
    with pytest.raises(InputError, match="certain positions"):
        moved(replace(corner, pose_covariance=np.eye(6)), np.eye(4))
