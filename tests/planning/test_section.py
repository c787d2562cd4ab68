"""Horizontal sections of a map."""

import numpy as np
import pytest

from semgp.baselines.knn import KNNMap
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.planning.section import section
from tests.conftest import THREE


class TestSection:
    def test_it_says_what_the_map_says(self, corner: LabelledCloud) -> None:
        knn = KNNMap(corner.classes)
        knn.update(corner)
        cut = section(knn, 0.8, (0.0, 0.0), (2.0, 1.0), resolution=0.1)
        assert cut.label.shape == (10, 20)
        there = knn.query([[0.75, 0.55, 0.8]])
        assert cut.label[5, 7] == there.label[0]
        assert cut.entropy[5, 7] == pytest.approx(there.entropy[0])
        assert not cut.free.any()

    def test_free_space_is_told_from_what_is_there(self, corner: LabelledCloud) -> None:
        gp_map = GPSemanticMap(corner.classes, free=FreeSpace())
        gp_map.update(corner)
        cut = section(gp_map, 1.0, (-1.0, -1.0), (3.0, 2.5), resolution=0.1)
        assert cut.free.any()
        assert (cut.label[cut.free] == -1).all()
        assert np.isnan(cut.entropy).any()  # behind the wall
        assert (cut.label[cut.label >= 0] == 1).mean() > 0.5  # the wall
        page = cut.picture()
        assert page.shape[1] > 1400
        assert (page == THREE.colours[1]).all(axis=2).any()

    def test_bad_input(self, corner: LabelledCloud) -> None:
        knn = KNNMap(corner.classes)
        with pytest.raises(InputError, match="empty"):
            section(knn, 1.0)
        knn.update(corner)
        for arguments in ((np.nan,), (1.0, (0, 0), (-1, 1)), (1.0, (0, np.inf), (1, 1))):
            with pytest.raises(InputError):
                section(knn, *arguments)
        with pytest.raises(InputError, match="resolution"):
            section(knn, 1.0, resolution=0.0)
        with pytest.raises(InputError):
            section(knn, 1.0, resolution=1e-7)
