"""What no surface can be made of."""

import sys
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from semgp.errors import InputError, MissingExtraError
from semgp.maps.gp import GPSemanticMap
from semgp.octomap.semantic import SemanticOctoMap
from semgp.prediction import Prediction
from semgp.surfaces import Mesh, lattice, surface
from tests.surfaces.corner import ROOM, scan_of_a_corner
from tests.surfaces.fields import TWO, ball, solid
from tests.surfaces.meshes import needs_extra, quiet, triangle

pytestmark = quiet


class TestRefusals:
    @pytest.mark.parametrize("resolution", [0, -1.0, np.nan, np.inf])
    @needs_extra
    def test_resolution(self, resolution: float) -> None:
        with pytest.raises(InputError, match="resolution must be a number, positive"):
            surface(solid(ball, 1.1), resolution=resolution)

    @pytest.mark.parametrize("level", [0, 1, -0.1, np.nan])
    @needs_extra
    def test_level(self, level: float) -> None:
        with pytest.raises(InputError, match="probability between 0 and 1"):
            surface(solid(ball, 1.1), resolution=0.1, level=level)

    @needs_extra
    def test_an_unknown_class_lists_the_known(self) -> None:
        with pytest.raises(InputError, match=r"'roof'.*'occupied' or of a class of low, high"):
            surface(solid(ball, 1.1), "roof", resolution=0.1)

    @pytest.mark.parametrize(("low", "high"), [((1, 1, 1), (1, 2, 2)), ((0, 0), None), (None, (0, 0, np.nan))])
    @needs_extra
    def test_box(self, low: ArrayLike | None, high: ArrayLike | None) -> None:
        with pytest.raises(InputError, match="a box needs two corners"):
            surface(solid(ball, 1.1), resolution=0.1, low=low, high=high)

    @needs_extra
    def test_empty_maps(self) -> None:
        with pytest.raises(InputError, match="the map is empty"):
            surface(SemanticOctoMap(TWO, 0.1), resolution=0.1)

    @needs_extra
    def test_maps_without_free_space(self) -> None:
        cloud = scan_of_a_corner()
        unseen = SemanticOctoMap(ROOM, 0.1, rays=False)
        unseen.update(cloud)
        plain = GPSemanticMap(ROOM)
        plain.update(cloud)
        silent = solid(ball, 1.1)
        silent.query = lambda X: Prediction(TWO, np.full((len(X), 2), 0.5), np.ones(len(X), bool))  # type: ignore
        other: Any = object()
        cases = ((unseen, "occupied"), (plain, "occupied"), (silent, TWO.names[0]), (other, "occupied"))
        for semantic_map, what in cases:
            with pytest.raises(InputError, match=r"no free space.*free=FreeSpace\(\)"):
                surface(semantic_map, what, resolution=0.1)

    @needs_extra
    def test_a_grid_too_large_says_what_fits(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(lattice, "MOST_NODES", 100_000)
        for resolution in (1e-320, 1e-9, 0.01):
            with pytest.raises(InputError, match="more than 100,000 nodes") as refused:
                surface(solid(ball, 1.1), resolution=resolution)
        fitting = float(str(refused.value).split("resolution of ")[1].split(" m")[0])
        assert 0.03 < fitting < 0.2
        assert len(surface(solid(ball, 1.1), resolution=fitting).faces) > 0

    def test_without_the_extra(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "skimage.measure", None)
        with pytest.raises(MissingExtraError, match=r"semgp\[mesh\]"):
            surface(solid(ball, 1.1), resolution=0.1)

    def test_meshes_that_make_no_sense(self) -> None:
        good = triangle(np.zeros(3))
        for name, value in (
            ("normals", np.zeros((2, 3))),
            ("label", np.zeros(4, dtype=np.int32)),
            ("variance", np.zeros((3, 1))),
            ("faces", np.zeros((1, 4), dtype=np.int32)),
            ("faces", np.array([[0, 1, 3]], dtype=np.int32)),
        ):
            with pytest.raises(InputError, match=name):
                Mesh(**{**vars(good), name: value})
