"""Half-lives of what a map holds, in scans and in seconds; settings that forget nothing."""

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.cloud import LabelledCloud
from semgp.maps.forgetting import Forgetting
from semgp.maps.gp import GPSemanticMap
from tests.maps.forgetting.scenes import (
    EDGE,
    NEVER,
    SENSOR,
    assert_same_masses,
    masses,
    near,
    new,
    off,
    patch,
    scan,
    updated,
)

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


class TestHalfLife:
    """One patch in a cell is seen once, another one in the same cell again and again."""

    HERE, THERE, EYE = np.array([4.0, 1.5, 1.5]), np.array([1.5, 4.0, 1.5]), np.array([1.5, 1.5, 1.5])
    AWAY, OTHER_EYE = np.array([10.0, 1.5, 1.5]), np.array([7.6, 1.5, 1.5])

    def mass_near(self, made: GPSemanticMap, at: F64, prefix: str = "") -> I64:
        """Class mass (n, C) of the sites of a patch, in the order of voxels."""
        found = masses(made, prefix)
        return np.array([found[v] for v in sorted(found) if (np.abs(np.array(v) * EDGE - at) < 0.36).all()])

    @pytest.mark.parametrize("scans", [1, 4, 12])
    def test_in_scans(self, scans: int) -> None:
        made = updated(new(Forgetting(4.0)), patch(self.HERE, self.EYE))
        before = [self.mass_near(made, self.HERE, prefix) for prefix in ("", "free.")]
        assert [len(b) > 50 for b in before] == [True, True]
        updated(made, *[patch(self.THERE, self.EYE)] * scans)
        for prefix, mass in zip(("", "free."), before):
            now = self.mass_near(made, self.HERE, prefix)
            np.testing.assert_allclose(now, mass * 0.5 ** (scans / 4), atol=0.5 / (1 - 0.5**0.25) + 0.51)
        fresh = self.mass_near(made, self.THERE)
        once = self.mass_near(updated(new(None), patch(self.THERE, self.EYE)), self.THERE)
        np.testing.assert_allclose(fresh, once * sum(0.5 ** (i / 4) for i in range(scans)), atol=4 * scans)

    def test_in_seconds(self) -> None:
        made = updated(new(Forgetting(20.0, per="second")), patch(self.HERE, self.EYE, stamp=1.7e9))
        before = self.mass_near(made, self.HERE)
        for seconds in (0.0, 3.0, 10.0):
            updated(made, patch(self.THERE, self.EYE, stamp=1.7e9 + seconds))
        np.testing.assert_allclose(self.mass_near(made, self.HERE), before * 0.5 ** (10 / 20), atol=2)
        updated(made, patch(self.THERE, self.EYE, stamp=1.7e9 + 1e6))
        assert near(made.positions, self.HERE).sum() == 0 < near(made.positions, self.THERE).sum()

    def test_what_no_scan_comes_near_stays(self) -> None:
        made = updated(new(Forgetting(4.0)), patch(self.AWAY, self.OTHER_EYE))
        before = [self.mass_near(made, self.AWAY, prefix) for prefix in ("", "free.")]
        updated(made, *[patch(self.THERE, self.EYE)] * 9)
        for prefix, mass in zip(("", "free."), before):
            np.testing.assert_array_equal(self.mass_near(made, self.AWAY, prefix), mass)
        updated(made, patch(off(self.AWAY, -1.0, 2.5, 0), self.OTHER_EYE))  # and then fades for all that time
        for prefix, mass in zip(("", "free."), before):
            np.testing.assert_allclose(self.mass_near(made, self.AWAY, prefix), mass * 0.5 ** (10 / 4), atol=1)

    def test_labels_beyond_the_reach_of_rays(self) -> None:
        """Labels that come in again and again are young, however far away they were seen from."""
        made = updated(new(Forgetting(4.0), reach=2.0), *[patch(self.AWAY, self.EYE)] * 12)
        updated(made, patch(off(self.OTHER_EYE, 1.0, 0, 0), self.OTHER_EYE))
        once = self.mass_near(updated(new(None), patch(self.AWAY, self.EYE)), self.AWAY)
        expected = once * sum(0.5 ** (i / 4) for i in range(1, 13))
        np.testing.assert_allclose(self.mass_near(made, self.AWAY), expected, atol=50)


class TestNothingForgotten:
    """passed=1 and a half-life of ages change nothing but the samples in occupied voxels, which all count."""

    def clouds(self) -> list[LabelledCloud]:
        return [scan(0.0 if i < 2 else None, i) for i in range(5)]

    def test_all_samples_count(self) -> None:
        kept, same = (updated(new(f, thin=1), *self.clouds()) for f in (None, NEVER))
        assert_same_masses(kept, same)
        X = SENSOR + np.random.default_rng(1).uniform((-0.5, -2, -2), (4, 2, 2), (2000, 3))
        np.testing.assert_array_equal(kept.query(X).probability, same.query(X).probability)
        np.testing.assert_array_equal(kept.occupancy(X).probability, same.occupancy(X).probability)
        np.testing.assert_array_equal(kept.positions, same.positions)

    def test_few_samples_count(self) -> None:
        kept, same = (updated(new(f), *self.clouds()) for f in (None, NEVER))
        assert masses(kept) == masses(same)
        a, b = masses(kept, "free."), masses(same, "free.")
        assert a.keys() == b.keys()
        other = [v for v in a if a[v] != b[v]]
        assert len(other) > 10
        assert all(b[v][1] == a[v][1] > 0 and b[v][0] > a[v][0] for v in other)
