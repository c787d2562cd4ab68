"""Pieces of HTML in the live viewer's panel."""

from dataclasses import replace

import numpy as np

from semgp.classes import Classes
from semgp.prediction import Prediction
from semgp.viewer import cards
from semgp.viewer.fields import Scale
from semgp.viewer.sample import Sample


def test_cards(sample: Sample) -> None:
    pieces = cards.answer(sample, 0)
    probability = sample.prediction.probability[0]
    names = [sample.prediction.classes.names[c] for c in np.argsort(-probability)]
    assert [pieces.index(f'title="{name}"') for name in names] == sorted(
        pieces.index(f'title="{name}"') for name in names
    )
    assert f"x {sample.points[0, 0]:.2f}" in pieces
    assert f"{100 * probability.max():.1f} %" in pieces
    assert "variance" in pieces
    assert "occupancy" in pieces
    assert "2.5 &lt;b&gt;" in cards.colour_bar(Scale(0, 2.5), "<b>")
    assert cards.colour_bar(None, "") == ""
    assert "&lt;script&gt;" in cards.message("<script>")


def test_a_point_lists_likely_classes_and_sums_up_the_others() -> None:
    p = np.array([[0.9, 0.0998, *[0.00002] * 10]])
    prediction = Prediction(Classes.numbered(12), p, np.ones(1, bool), variance=np.full((1, 12), 0.25))
    sample = Sample(np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1, bool), prediction, 0.1)
    told = cards.answer(sample, 0)
    assert told.count('class="of"') == 2
    assert "10 others" in told
    assert told.count("0.25") == 1  # the classes share it
    own = replace(prediction, variance=np.arange(12)[None] + 0.5)
    assert "<th>variance</th>" in cards.answer(replace(sample, prediction=own), 0)
