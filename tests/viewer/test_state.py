"""What is seen of a sample: fields, choices, picking."""

from dataclasses import replace

import numpy as np
import pytest

from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.picture.colour import by_class
from semgp.viewer.fields import field_called, field_names, field_scale, field_values
from semgp.viewer.sample import Sample
from semgp.viewer.sight import lit, pick
from semgp.viewer.state import ViewState, show


def test_fields(sample: Sample) -> None:
    prediction = sample.prediction
    names = field_names(prediction)
    assert names[:5] == ("class", "confidence", "entropy", "variance", "occupancy")
    assert names[5:] == tuple(f"probability of {name}" for name in prediction.classes.names)
    assert field_called(prediction, "wall") == "probability of wall"
    seen = prediction.observed
    expected = np.where(seen, prediction.probability[:, 1], np.nan)
    np.testing.assert_array_equal(field_values(prediction, "wall"), expected)
    assert np.isnan(field_values(prediction, "entropy")[~seen]).all()
    for name in names[1:]:
        scale, values = field_scale(prediction, name), field_values(prediction, name)
        assert scale.low < scale.high
        assert np.nanmin(values) >= scale.low - 1e-9
        assert np.nanmax(values) <= scale.high + 1e-9
    with pytest.raises(InputError, match=r"no field 'colour'.*entropy.*wall"):
        field_called(prediction, "colour")


def test_show_hides_classes_and_cuts(sample: Sample) -> None:
    state = ViewState(0.15).switched(0, on=False)
    shown = show(sample, replace(state, low=(-np.inf, 0.5, -np.inf)))
    label = sample.prediction.label
    expected = [i for i in range(len(label)) if label[i] != 0 and sample.points[i, 1] >= 0.5]
    assert shown.rows.tolist() == expected
    np.testing.assert_array_equal(shown.colours, by_class(label[expected], sample.prediction.classes))
    assert state.switched(0, on=True) == ViewState(0.15)
    values = show(sample, replace(state, field="entropy"))
    assert values.scale == field_scale(sample.prediction, "entropy")
    assert len(np.unique(values.colours, axis=0)) > 10
    assert (lit(shown, (0, 0, 1)) <= shown.colours).all()
    assert not len(show(sample, replace(state, hidden=frozenset({MISSING, 0, 1, 2}))).rows)


def test_pick_takes_the_first_point_that_a_ray_meets(sample: Sample) -> None:
    shown = show(sample, ViewState(0.15))
    eye = np.array([1.0, -3.0, 4.0])
    rng = np.random.default_rng(1)
    for row in rng.choice(shown.rows, 20):
        found = pick(shown, eye, sample.points[row] - eye)
        assert found is not None
        reach = np.linalg.norm(sample.points[[row, found]] - eye, axis=1)
        assert reach[1] <= reach[0] + 0.31
    assert pick(shown, eye, (0, -1, 0)) is None
    assert pick(show(sample, ViewState(0.15, hidden=frozenset(range(-1, 3)))), eye, (0, 1, -1)) is None
