"""Reliability and costs as curves."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.errors import InputError, MissingExtraError
from semgp.evaluation.calibration import reliability
from semgp.evaluation.curves import cost_figure, pooled, reliability_figure
from semgp.evaluation.task import Result
from tests.evaluation.pictures import opened


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_pooled_diagram_is_that_of_all_points(seed: int, parts: int) -> None:
    rng = np.random.default_rng(seed)
    p = rng.dirichlet(np.ones(3), 60) * (rng.random((60, 1)) < 0.8)
    y = rng.integers(0, 3, 60)
    cuts = np.array_split(np.arange(60), parts)
    together, one_by_one = reliability(p, y), pooled([reliability(p[i], y[i]) for i in cuts])
    assert np.array_equal(together.count, one_by_one.count)
    assert np.allclose(together.confidence, one_by_one.confidence, equal_nan=True)
    assert np.allclose(together.accuracy, one_by_one.accuracy, equal_nan=True)
    assert one_by_one.ece == pytest.approx(together.ece)


def test_curves_are_pictures(results: list[Result]) -> None:
    one = opened(reliability_figure(results))
    other = [replace(result, experiment="other", n_train=9 * result.n_train) for result in results]
    two = opened(reliability_figure([*results, *other]))
    assert two.shape[0] > 1.5 * one.shape[0]
    assert two.shape[1] == one.shape[1]
    costs = opened(cost_figure([*results, *other]))
    assert len(np.unique(costs.reshape(-1, costs.shape[2]), axis=0)) > 20


def test_curves_need_results() -> None:
    for draw in (reliability_figure, cost_figure):
        with pytest.raises(InputError, match="no results"):
            draw([])


def test_curves_need_matplotlib(results: list[Result], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    for draw in (reliability_figure, cost_figure):
        with pytest.raises(MissingExtraError, match=r"semgp\[figures\]"):
            draw(results)
