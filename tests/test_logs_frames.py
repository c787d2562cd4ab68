"""Frames: interpolation, trees of frames, and what tf2 ignores."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from semgp.logs.frames import NS, Frames, NoTransformError
from semgp.logs.rigid import between, quaternion, transform
from tests.log_samples import pose


def tf(parent: str, child: str, T: NDArray[np.float64], stamp: float = 0.0, scale: float = 1.0) -> Any:
    q = scale * Rotation.from_matrix(T[:3, :3]).as_quat()
    header = SimpleNamespace(frame_id=parent, stamp=SimpleNamespace(sec=int(stamp), nanosec=round(stamp % 1 * NS)))
    moved = SimpleNamespace(
        translation=SimpleNamespace(**dict(zip("xyz", T[:3, 3]))), rotation=SimpleNamespace(**dict(zip("xyzw", q)))
    )
    return SimpleNamespace(transforms=[SimpleNamespace(header=header, child_frame_id=child, transform=moved)])


def frames(*edges: tuple[Any, bool], max_gap: float = 1.0) -> Frames:
    made = Frames(max_gap)
    for message, fixed in edges:
        made.add(message, fixed=fixed)
    return made


@given(st.integers(0, 10_000), st.floats(0, 1))
def test_slerp_as_scipy_has_it(seed: int, share: float) -> None:
    a, b = Rotation.random(2, random_state=np.random.RandomState(seed))
    rows = np.zeros((2, 7))
    rows[:, 3:] = a.as_quat(), -b.as_quat()  # either sign is the same rotation
    found = transform(between(rows[0], rows[1], share))[:3, :3]
    np.testing.assert_allclose(found, Slerp([0, 1], Rotation.concatenate([a, b]))(share).as_matrix(), atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, np.pi - 1e-9])
def test_slerp_of_small_and_large_turns(angle: float) -> None:
    rows = np.zeros((2, 7))
    rows[0, 6] = 1
    rows[1, 3:] = Rotation.from_rotvec([0, 0, angle]).as_quat()
    found = Rotation.from_matrix(transform(between(rows[0], rows[1], 0.25))[:3, :3]).as_rotvec()
    np.testing.assert_allclose(found, [0, 0, angle / 4], atol=1e-12)


@given(st.integers(0, 10_000))
def test_quaternions_as_scipy_has_them(seed: int) -> None:
    R = Rotation.random(random_state=np.random.RandomState(seed))
    q = quaternion(R.as_matrix())
    expected = R.as_quat()
    np.testing.assert_allclose(q * np.sign(q @ expected), expected, atol=1e-12)
    np.testing.assert_allclose(transform(np.append([1, 2, 3], q))[:3, :3], R.as_matrix(), atol=1e-12)


def test_up_and_down_the_tree() -> None:
    A, B, C = pose(1, 2, 3, yaw=1), pose(0, 1, 0, pitch=0.5), pose(-1, 0, 2, yaw=-2)
    tree = frames((tf("map", "base", A), True), (tf("base", "left", B), True), (tf("/base", "/right", C), True))
    np.testing.assert_allclose(tree.lookup("map", "left", 0), A @ B, atol=1e-12)
    np.testing.assert_allclose(tree.lookup("left", "map", 0), np.linalg.inv(A @ B), atol=1e-12)
    np.testing.assert_allclose(tree.lookup("left", "right", 0), np.linalg.inv(B) @ C, atol=1e-12)
    np.testing.assert_allclose(tree.lookup("elsewhere", "elsewhere", 0), np.eye(4))
    assert tree.root("right") == "map"
    assert tree.names == ["base", "left", "map", "right"]


def test_samples_may_come_in_any_order_and_the_last_of_equal_stamps_counts() -> None:
    edges = [(tf("map", "base", pose(x, 0, 0), t), False) for x, t in ((2, 2), (0, 0), (9, 1), (1, 1))]
    tree = frames(*edges)
    for t in (0, 0.5, 1, 1.75, 2):
        assert tree.lookup("map", "base", round(t * NS))[0, 3] == pytest.approx(t)


@pytest.mark.parametrize(
    ("t", "problem"), [(-1, "from 0.000 s to 5.000 s, not at -1.000 s"), (3, "gap of 4.00 s")]
)
def test_moments_without_samples(t: float, problem: str) -> None:
    tree = frames(*[(tf("map", "base", np.eye(4), at), False) for at in (0, 1, 5)])
    with pytest.raises(NoTransformError, match=problem):
        tree.lookup("map", "base", round(t * NS))


def test_what_tf2_ignores_is_ignored() -> None:
    tree = frames(
        (tf("map", "base", pose(1, 0, 0)), False),
        (tf("map", "base", pose(2, 0, 0), scale=0.5), False),
        (tf("map", "base", pose(np.nan, 0, 0)), False),
    )
    assert tree.lookup("map", "base", 0)[0, 3] == 1


def test_circles_and_contradictions_are_refused() -> None:
    circle = frames((tf("a", "b", np.eye(4)), True), (tf("b", "a", np.eye(4)), True))
    with pytest.raises(NoTransformError, match="circle"):
        circle.lookup("c", "a", 0)
    twice = frames((tf("a", "b", np.eye(4)), True), (tf("a", "b", np.eye(4)), True))
    np.testing.assert_array_equal(twice.lookup("a", "b", 0), np.eye(4))
    twice.add(tf("a", "b", pose(1, 0, 0)), fixed=True)
    with pytest.raises(NoTransformError, match="different things of 'b' in 'a'"):
        twice.lookup("a", "b", 0)
    both = frames((tf("a", "b", np.eye(4)), True), (tf("a", "b", np.eye(4)), False))
    with pytest.raises(NoTransformError, match="both moving and fixed"):
        both.lookup("a", "b", 0)


def test_old_samples_are_forgotten_but_the_newest_never() -> None:
    tree = frames(*[(tf("map", "base", pose(t, 0, 0), t), False) for t in range(20)])
    tree.forget(3)
    assert tree.lookup("map", "base", 17 * NS)[0, 3] == 17
    with pytest.raises(NoTransformError, match=r"from 16.000 s to 19.000 s"):
        tree.lookup("map", "base", 10 * NS)
