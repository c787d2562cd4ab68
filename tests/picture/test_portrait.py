"""Portraits of maps: layers, keys, scale bars."""

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.picture import DARK, splat
from semgp.picture.camera import Camera
from semgp.picture.portrait import (
    Layer,
    cloud_layers,
    length_in_words,
    map_layers,
    metres_per_pixel,
    portrait,
    with_scale_bar,
)
from semgp.prediction import Prediction
from semgp.upward import direction
from tests.conftest import THREE
from tests.picture.clouds import on_screen


class TestPortrait:
    points = np.array([(x, y, 0.0) for x in np.linspace(-1, 1, 60) for y in np.linspace(-1, 1, 60)])
    view = Camera(elevation=90.0).view(points, 240, 160)

    def layers(self, *names: str) -> list[Layer]:
        p = np.zeros((len(self.points), 3))
        p[np.arange(len(p)), (self.points[:, 0] > 0).astype(int)] = 1
        return map_layers(self.points, 0.04, Prediction(THREE, p, np.ones(len(p), bool)), names)

    def test_a_single_layer_without_keys_is_the_splat(self) -> None:
        (layer,) = self.layers("class")
        page = portrait([layer], self.view, keys=False, scale_bar=False)
        np.testing.assert_array_equal(page, splat(self.points, layer.paint.colours, self.view, layer.size))

    def test_panels_titles_and_keys_add_up(self) -> None:
        one = portrait(self.layers("class"), self.view, keys=False)
        two = portrait(self.layers("class", "entropy"), self.view, keys=False)
        keyed = portrait(self.layers("class", "entropy"), self.view, title="A plane", background=DARK)
        assert one.shape == (160, 240, 3)
        assert two.shape[1] > 480
        assert keyed.shape[0] > two.shape[0] + 40
        assert keyed.shape[1] == two.shape[1]
        assert (keyed[0, 0] == DARK).all()
        for colour in THREE.colours[:2]:
            assert (keyed[two.shape[0] :] == colour).all(axis=2).sum() > 50

    def test_what_is_not_observed_is_left_out(self) -> None:
        seen = self.points[:, 1] > 0
        p = np.full((len(self.points), 3), 1 / 3)
        (layer,) = map_layers(self.points, 0.04, Prediction(THREE, p, seen), ["class"])
        np.testing.assert_array_equal(layer.points, self.points[seen])
        assert not map_layers(self.points, 0.04, Prediction(THREE, p, seen & False), ["class"])
        with pytest.raises(InputError, match="layer"):
            portrait([], self.view)

    def test_scans_beside_a_map(self, corner: LabelledCloud) -> None:
        up = direction("z")
        colours, labels = cloud_layers([corner, corner], ["class", "rgb"], 0.5, up)
        assert len(labels.points) == len(colours.points) == 2 * np.count_nonzero(corner.points[:, 2] <= 0.5)
        assert labels.paint.missing == "no label"
        assert (colours.paint.colours == 90).all()
        assert cloud_layers([], ["class"], None, up) == []
        with pytest.raises(InputError, match="--cloud"):
            cloud_layers([], ["rgb"], None, up)

    def test_the_scale_bar_measures_what_it_says(self) -> None:
        per_pixel = metres_per_pixel(self.points, self.view)
        left, right = (v[0] for v in on_screen(self.view, np.array([(-1, 0, 0.0), (1, 0, 0)])))
        assert 2 / ((right - left) / 2 * self.view.width) == pytest.approx(per_pixel, rel=1e-6)
        blank = np.full((300, 600, 3), 255, dtype=np.uint8)
        page = with_scale_bar(blank, 0.01)  # a fifth of the width is 1.2 m
        dark = np.flatnonzero((page[300 - 12] < 100).all(axis=1))
        assert np.ptp(dark) == pytest.approx(100, abs=3)  # 1 m

    def test_lengths_in_words(self) -> None:
        words = {0.005: "5 mm", 0.2: "20 cm", 1.0: "1 m", 50.0: "50 m", 2000.0: "2 km"}
        assert {metres: length_in_words(metres) for metres in words} == words
