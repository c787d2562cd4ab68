"""Maps asked in batches."""

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.maps.batches import query_in_batches
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.prediction import OccupancyPrediction


def test_batches_answer_what_one_query_does(corner: LabelledCloud, monkeypatch: pytest.MonkeyPatch) -> None:
    gp_map = GPSemanticMap(corner.classes, free=FreeSpace())
    gp_map.update(corner)
    X, seen = np.random.default_rng(0).uniform(0, 2, (100, 3)), []
    whole = gp_map.query(X)
    monkeypatch.setattr("semgp.maps.batches.BATCH", 30)
    parts = query_in_batches(gp_map, X, lambda n, total: seen.append((n, total)))
    assert seen == [(30, 100), (60, 100), (90, 100), (100, 100)]
    np.testing.assert_allclose(parts.probability, whole.probability, atol=1e-5)
    np.testing.assert_array_equal(parts.observed, whole.observed)
    assert isinstance(parts.occupancy, OccupancyPrediction)
    assert whole.occupancy is not None
    np.testing.assert_allclose(parts.occupancy.probability, whole.occupancy.probability, atol=1e-5)
    assert len(query_in_batches(gp_map, np.empty((0, 3)))) == 0
