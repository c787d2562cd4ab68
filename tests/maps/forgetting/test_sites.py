"""Sites fade: half of the mass after a half-life, in steps of any length."""

import numpy as np
import pytest

from semgp.blocks.accumulate import MASS_UNIT
from semgp.blocks.cells import cell_keys
from semgp.blocks.observations import Observations
from semgp.blocks.sites import Sites
from tests.maps.forgetting.scenes import EDGE


class TestSites:
    """Fading itself, on sites."""

    def made(self, n: int = 200) -> Sites:
        rng = np.random.default_rng(3)
        sites = Sites(3, 1, EDGE)
        weights = (rng.random((n, 3)) * rng.choice([0.5, 5, 50], (n, 1))).astype(np.float32)
        features = rng.normal(size=(n, 1)).astype(np.float32)
        draws = np.ones(n, np.int64)
        sites.add(
            Observations(
                rng.uniform(0, 18, (n, 3)), None, weights, features, None, rng.random((n, 3)) * 0.01, draws
            )
        )
        return sites

    @pytest.mark.parametrize("half_life", [1.0, 3.0, 10.0, 64.0])
    @pytest.mark.parametrize("at_once", [False, True])
    def test_half_of_the_mass_after_a_half_life(self, half_life: float, at_once: bool) -> None:
        sites = self.made()
        before = sites.mass.astype(float)
        cells = np.arange(len(sites.cells))
        assert len(cells) > 8
        for step in range(0 if at_once else int(half_life)):
            sites.clock = step + 1.0
            sites.fade(cells, half_life)
        sites.clock = half_life
        sites.fade(cells, half_life)
        rounding = 0.51 if at_once else 0.5 / (1 - 0.5 ** (1 / half_life)) + 0.51
        assert np.abs(sites.mass - before / 2).max() <= rounding

    @pytest.mark.parametrize("half_life", [3000, 10_000])
    def test_long_half_lives_in_short_steps(self, half_life: int) -> None:
        """Ten scans a second, ten minutes: labels must fade all the same."""
        sites = Sites(1, 0, EDGE)
        points = np.array([[0.05, 0.05, 0.05], [0.15, 0.05, 0.05], [0.25, 0.05, 0.05]])
        sites.add(
            Observations(points, None, np.array([[0.5], [1.0], [4.0]], np.float32), np.empty((3, 0), np.float32))
        )
        before = sites.mass.astype(float)
        for step in range(half_life):
            sites.clock = step + 1.0
            sites.fade(np.array([0]), half_life)
        np.testing.assert_allclose(sites.mass, before / 2, rtol=0.1)

    def test_what_stays(self) -> None:
        """Positions, features, variances and, to rounding, shares."""
        sites = self.made()
        where, mass, place, spread = sites.positions, sites.mass, sites.place.copy(), sites.spread.copy()
        share, total = mass / mass.sum(axis=1, keepdims=True), mass.sum(axis=1, dtype=float)
        sites.clock = 2.0
        sites.fade(np.arange(len(sites.cells)), 1.0)
        now = sites.mass.sum(axis=1, dtype=float)
        heavy = total > MASS_UNIT
        np.testing.assert_allclose(now[heavy], total[heavy] / 4, rtol=2e-3)
        np.testing.assert_allclose(sites.positions, where, atol=1e-7 * EDGE)
        np.testing.assert_allclose(sites.place[:, 3] / now, place[:, 3] / total, atol=1)
        np.testing.assert_allclose(sites.spread[:, :3] / now[:, None], spread[:, :3] / total[:, None], atol=1)
        np.testing.assert_array_equal(sites.spread[:, 3], spread[:, 3])
        np.testing.assert_allclose((sites.mass / now[:, None])[heavy], share[heavy], atol=2e-3)

    def test_a_trace_stays_of_the_most_probable_class(self) -> None:
        sites = self.made()
        top = sites.mass.argmax(axis=1)
        sites.clock = 200.0
        sites.fade(np.arange(len(sites.cells)), 1.0)
        assert (sites.mass.max(axis=1) == 1).all()
        assert (sites.mass[np.arange(len(sites)), top] == 1).all()

    def test_a_trace_stays_in_its_place(self) -> None:
        sites = self.made()
        where = sites.positions
        for step in (40.0, 200.0, 300.0):
            sites.clock = step
            sites.fade(np.arange(len(sites.cells)), 1.0)
            assert (sites.mass.sum(axis=1) >= 1).all()
            np.testing.assert_allclose(sites.positions, where, atol=1e-6 * EDGE)

    def test_cells_fade_by_themselves(self) -> None:
        sites = self.made()
        before, cell = sites.mass.copy(), sites.cells.find(cell_keys(sites.voxels.keys))
        sites.clock = 1.0
        sites.fade(np.array([2, 5]), 1.0)
        faded = np.isin(cell, [2, 5])
        assert 0 < faded.sum() < len(sites)
        np.testing.assert_array_equal(sites.mass[~faded], before[~faded])
        assert (sites.mass[faded].sum(axis=1) < 0.51 * before[faded].sum(axis=1)).all()
        sites.clock = 2.0
        sites.fade(np.arange(len(sites.cells)), 1.0)  # each for all the time since it last did
        np.testing.assert_allclose(sites.mass, before / 4, atol=1.0)

    def test_a_new_cell_does_not_fade_for_the_time_before_it(self) -> None:
        sites = Sites(1, 0, EDGE)
        sites.clock = 100.0
        sites.add(Observations(np.zeros((1, 3)), np.zeros(1, np.int32), None, np.empty((1, 0), np.float32)))
        sites.clock = 101.0
        sites.fade(np.array([0]), 1.0)
        assert sites.mass.tolist() == [[MASS_UNIT // 2]]

    def test_single_sites(self) -> None:
        sites = self.made()
        before, where = sites.mass.copy(), sites.positions
        rows = np.array([3, 50, 51, 117])
        sites.drift[:] = 0
        cells = sites.fade_sites(rows, 0.25)
        np.testing.assert_allclose(sites.mass[rows], before[rows] / 4, atol=0.51)
        np.testing.assert_array_equal(np.delete(sites.mass, rows, axis=0), np.delete(before, rows, axis=0))
        np.testing.assert_allclose(sites.positions, where, atol=1e-7 * EDGE)
        assert sites.drift.sum() == pytest.approx(4 * 0.75 / 2)
        assert cells.tolist() == np.flatnonzero(sites.drift).tolist()
