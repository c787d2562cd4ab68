"""Exponential, logarithm and the inverse Cholesky factor in single precision, against numpy in double."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.blocks.elementary import exp_minus, log
from semgp.blocks.linear import inverse_factor, pack, packed_size, unpack
from semgp.gp.stationary import Matern52


def test_exponential_over_its_range() -> None:
    t = np.concatenate([np.linspace(0, 100, 20_000), np.geomspace(1e-30, 1, 2_000)]).astype(np.float32)
    found = np.array([exp_minus(v) for v in t], dtype=np.float64)
    np.testing.assert_allclose(found, np.exp(-t.astype(np.float64)), rtol=0, atol=2e-7)
    small = t < 80  # a member far away still counts for what it is worth, relative to others as far
    np.testing.assert_allclose(found[small], np.exp(-t[small].astype(np.float64)), rtol=2e-5)


def test_exponential_at_the_ends() -> None:
    assert exp_minus(np.float32(0)) == pytest.approx(1, abs=2e-7)
    assert 0 <= exp_minus(np.float32(1e30)) < 2e-38


def test_exponential_falls() -> None:
    t = np.linspace(0, 30, 5_000, dtype=np.float32)
    found = np.array([exp_minus(v) for v in t])
    assert (np.diff(found) <= 2e-7 * found[:-1]).all()


def test_logarithm_over_its_range() -> None:
    x = np.concatenate([np.geomspace(2e-38, 3e38, 20_000), np.linspace(0.5, 2, 5_000)]).astype(np.float32)
    found = np.array([log(v) for v in x], dtype=np.float64)
    np.testing.assert_allclose(found, np.log(x.astype(np.float64)), rtol=2e-7, atol=2e-7)


@pytest.mark.parametrize("x", [0.0, 1e-45, 1e-39])
def test_logarithm_of_next_to_nothing_is_that_of_the_smallest_number(x: float) -> None:
    assert log(np.float32(x)) == pytest.approx(np.log(1.2e-38), rel=1e-6)


@given(st.floats(0, 60, width=32))
@settings(deadline=None, max_examples=200)
def test_each_undoes_the_other(t: float) -> None:
    assert -log(exp_minus(np.float32(t))) == pytest.approx(t, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("n", [1, 2, 7, 48, 49, 64, 96, 129])
def test_inverse_factor(n: int) -> None:
    X = np.random.default_rng(n).uniform(0, 2, (n, 3))
    A = Matern52(ell=(0.7,), sf=1.3)(X, X) + 0.1 * np.eye(n)
    found = np.full((n, n), np.nan, dtype=np.float32)
    inverse_factor(A.astype(np.float32), found)
    expected = np.linalg.inv(np.linalg.cholesky(A))
    assert (np.triu(found, 1) == 0).all()
    np.testing.assert_allclose(found, expected, atol=2e-5 * np.abs(expected).max())
    np.testing.assert_allclose(found.T.astype(np.float64) @ found @ A, np.eye(n), atol=2e-4)


@pytest.mark.parametrize("n", [0, 1, 2, 7, 48, 129])
def test_packed_triangles(n: int) -> None:
    """Row by row, what lies above the diagonal left out, and zeros there when unpacked."""
    L = np.random.default_rng(n).normal(size=(n, n)).astype(np.float32)
    size = packed_size(n)
    assert size == n * (n + 1) // 2
    wide = np.full(size + 3, np.nan, np.float32)  # other blocks' factors follow
    pack(L, wide[:size])
    assert np.isnan(wide[size:]).all()
    np.testing.assert_array_equal(wide[:size], L[np.tril_indices(n)])
    again = np.full((n, n), np.nan, np.float32)
    unpack(wide, again)
    np.testing.assert_array_equal(again, np.tril(L))
