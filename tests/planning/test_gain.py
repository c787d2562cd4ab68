"""Information gain against a loop over rays and samples, and channels against their joint distributions."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from semgp.baselines.knn import KNNMap
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.planning import information_gain, views
from semgp.planning.channels import class_information, occupancy_information
from semgp.planning.views import HARDLY
from tests.planning import naive
from tests.planning.box_world import room

F64 = NDArray[np.float64]


def pose(x: float, y: float, z: float, yaw: float = 0.0) -> F64:
    T = np.eye(4)
    T[:2, :2] = (np.cos(yaw), -np.sin(yaw)), (np.sin(yaw), np.cos(yaw))
    T[:3, 3] = x, y, z
    return T


def fan(n: int = 25, width: float = 0.6, seed: int = 0) -> F64:
    """Rays about the sensor's x axis, of any length."""
    rng = np.random.default_rng(seed)
    return np.column_stack([np.ones(n), rng.uniform(-width, width, (n, 2))]) * rng.uniform(0.1, 9, (n, 1))


POSES = np.stack([pose(0.5, 0.7, 1.2), pose(2.8, 2.0, 1.0, 0.3), pose(1.0, 2.5, 0.4, 4.0), pose(3.6, 1.5, 0.5)])


@pytest.mark.parametrize("error", [0.0, 0.03, 0.5])
def test_occupancy_channel(error: float) -> None:
    p = np.array([0.0, 0.01, 0.3, 0.5, 0.9, 1.0])
    channel = naive.symmetric_channel(2, error)
    joint = [naive.channel_information(np.array([1 - q, q]), channel) for q in p]
    np.testing.assert_allclose(occupancy_information(p, error), joint, atol=1e-12)


@pytest.mark.parametrize(("n_classes", "error"), [(2, 0.1), (3, 0.0), (5, 0.3), (4, 0.75)])
def test_class_channel(n_classes: int, error: float) -> None:
    prior = np.random.default_rng(0).dirichlet(np.full(n_classes, 0.5), 20)
    prior[0] = np.eye(n_classes)[0]
    channel = naive.symmetric_channel(n_classes, error)
    joint = [naive.channel_information(row, channel) for row in prior]
    np.testing.assert_allclose(class_information(prior, error), joint, atol=1e-12)


def test_one_class_tells_nothing() -> None:
    assert (class_information(np.ones((3, 1)), 0.0) == 0).all()


@pytest.mark.parametrize("settings", [{}, {"spacing": 0.23, "sensor_error": 0.0, "label_error": 0.5}])
def test_gains_are_those_of_the_loop(settings: dict[str, float]) -> None:
    world = room(softness=0.05)
    gain = information_gain(world, POSES, fan(), max_range=3.0, **settings)
    errors = settings.get("sensor_error", 0.05), settings.get("label_error", 0.2)
    spacing = settings.get("spacing", world.resolution)
    slow = [naive.gain(world, T, fan(), 3.0, spacing, errors, HARDLY) for T in POSES]
    np.testing.assert_allclose(gain.occupancy, [o for o, _ in slow], rtol=1e-9)
    np.testing.assert_allclose(gain.classes, [c for _, c in slow], rtol=1e-9)
    np.testing.assert_array_equal(gain.total, gain.occupancy + gain.classes)
    assert (gain.total > 0).all()


def test_views_in_small_portions_gain_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = information_gain(room(), POSES, fan(), max_range=3.0)
    monkeypatch.setattr(views, "_SAMPLES_AT_ONCE", 1000)
    np.testing.assert_allclose(information_gain(room(), POSES, fan(), max_range=3.0).total, whole.total)


def test_a_view_of_the_unknown_tells_more_than_one_of_the_known() -> None:
    to_unknown, to_wall = pose(2.9, 2.5, 1.5), pose(2.9, 2.5, 1.5, np.pi)
    gain = information_gain(room(), np.stack([to_unknown, to_wall]), fan(), max_range=2.0)
    assert gain.occupancy[0] > 2 * gain.occupancy[1]
    assert gain.classes[0] > gain.classes[1]


def test_rays_twice_tell_no_more_than_once() -> None:
    once = information_gain(room(), POSES, fan(), max_range=3.0)
    twice = information_gain(room(), POSES, np.tile(fan(), (2, 1)), max_range=3.0)
    np.testing.assert_allclose(twice.total, once.total)


def test_a_useless_sensor_tells_nothing() -> None:
    gain = information_gain(room(), POSES, fan(), max_range=3.0, sensor_error=0.5, label_error=2 / 3)
    np.testing.assert_allclose(gain.total, 0, atol=1e-10)


def test_each_voxel_is_asked_once() -> None:
    world = room()
    information_gain(world, np.tile(POSES[:1], (50, 1, 1)), fan(), max_range=3.0)
    assert sum(world.asked) <= 1 + 25 * 30


def test_no_views_and_no_rays() -> None:
    assert information_gain(room(), np.empty((0, 4, 4)), fan(), max_range=3.0).total.shape == (0,)
    assert information_gain(room(), POSES, np.empty((0, 3)), max_range=3.0).total.tolist() == [0] * 4


@pytest.mark.parametrize(
    ("poses", "d", "settings", "complaint"),
    [
        (np.eye(4), fan(), {}, "poses must have shape"),
        (np.full((1, 4, 4), np.nan), fan(), {}, "pose 0 has NaN"),
        (np.stack([np.eye(4), 2 * np.eye(4)]), fan(), {}, "pose 1 is no rigid transform"),
        (POSES, [(0, 0, 0)], {}, "row 0 is zero"),
        (POSES, fan(), {"max_range": -1}, "max_range must be"),
        (POSES, fan(), {"max_range": 1e9}, "shorten its range"),
        (POSES, fan(), {"max_range": 9e4}, "more than 16,777,216 samples a view"),
        (POSES, fan(), {"spacing": 0}, "spacing must be"),
        (POSES, fan(), {"sensor_error": 0.6}, "sensor_error must lie"),
        (POSES, fan(), {"label_error": 0.7}, "label_error must lie"),
        (POSES, fan(), {"label_error": np.nan}, "label_error must lie"),
    ],
)
def test_bad_input(poses: ArrayLike, d: ArrayLike, settings: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        information_gain(room(), poses, d, **{"max_range": 3.0, **settings})


def test_a_map_without_free_space(corner: LabelledCloud) -> None:
    flat = KNNMap(corner.classes)
    flat.update(corner)
    with pytest.raises(InputError, match=r"free=FreeSpace\(\)"):
        information_gain(flat, POSES, fan(), max_range=3.0)  # type: ignore[arg-type]
