"""Every kind of map against the same table of properties; a kind without a row fails."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semgp.baselines.bki import BKIMap
from semgp.baselines.csm import CSMMap
from semgp.baselines.knn import KNNMap
from semgp.blocks.model import BlockModel
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.gp.model import GPModel
from semgp.gp.stationary import Matern52
from semgp.maps.files import load_map, save_map
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.kinds import MAP_KINDS
from semgp.maps.protocol import SerialisableMap
from semgp.octomap import SemanticOctoMap

MAKERS: dict[str, Callable[[Classes], SerialisableMap]] = {
    "gp": lambda classes: GPSemanticMap(classes, BlockModel(resolution=0.02)),
    "gp, whole scan": lambda classes: GPSemanticMap(classes, GPModel(n_inducing=60)),
    "gp, vote": lambda classes: GPSemanticMap(classes, BlockModel(resolution=0.02, posterior="vote")),
    "gp, dirichlet": lambda classes: GPSemanticMap(classes, BlockModel(resolution=0.02, posterior="dirichlet")),
    "gp, softmax": lambda classes: GPSemanticMap(
        classes, BlockModel(Matern52((0.4,), 3.0), resolution=0.02, posterior="softmax", leaf=32)
    ),
    "gp, free space": lambda classes: GPSemanticMap(classes, BlockModel(resolution=0.02), free=FreeSpace()),
    "gp, forgetting": lambda classes: GPSemanticMap(
        classes, BlockModel(resolution=0.02), free=FreeSpace(), forgetting=Forgetting(1e9, passed=1.0)
    ),
    "octomap": lambda classes: SemanticOctoMap(classes, resolution=0.2),
    "knn": KNNMap,
    "csm": lambda classes: CSMMap(classes, resolution=0.2),
    "bki": lambda classes: BKIMap(classes, resolution=0.1, ell=0.3),
}


def test_every_kind_has_a_row() -> None:
    assert {name.split(",")[0] for name in MAKERS} == MAP_KINDS.keys()


@pytest.fixture(params=MAKERS)
def make(request: pytest.FixtureRequest) -> Callable[[Classes], SerialisableMap]:
    return MAKERS[request.param]


def built(make: Callable[[Classes], SerialisableMap], *clouds: LabelledCloud) -> SerialisableMap:
    semantic_map = make(clouds[0].classes)
    for cloud in clouds:
        semantic_map.update(cloud)
    return semantic_map


def test_it_learns_its_labels(make: Callable[[Classes], SerialisableMap], corner: LabelledCloud) -> None:
    prediction = built(make, corner).query(corner.points)
    known = corner.labelled & prediction.observed
    assert known.sum() > 0.95 * corner.labelled.sum()
    assert (prediction.label[known] == corner.hard_labels[known]).mean() > 0.95


def test_rows_are_probabilities(make: Callable[[Classes], SerialisableMap], corner: LabelledCloud) -> None:
    rng = np.random.default_rng(1)
    near_and_far = np.vstack([corner.points, rng.uniform(-50, 50, (100, 3))])
    prediction = built(make, corner).query(near_and_far)
    assert prediction.probability.shape == (len(near_and_far), len(corner.classes))
    np.testing.assert_allclose(prediction.probability.sum(axis=1), 1, rtol=1e-5)
    assert (prediction.probability >= 0).all()
    assert (prediction.label[~prediction.observed] == MISSING).all()
    if prediction.variance is not None:
        assert (prediction.variance >= 0).all()


def test_two_updates_equal_one(make: Callable[[Classes], SerialisableMap], corner: LabelledCloud) -> None:
    once = built(make, corner)
    halves = built(make, corner[1::2], corner[::2])
    np.testing.assert_allclose(
        halves.query(corner.points).probability, once.query(corner.points).probability, atol=1e-6
    )


def test_soft_one_hot_labels_equal_hard_ones(
    make: Callable[[Classes], SerialisableMap], corner: LabelledCloud
) -> None:
    soft = replace(corner, labels=None, weights=corner.class_weights)
    hard = built(make, corner).query(corner.points)
    np.testing.assert_allclose(built(make, soft).query(corner.points).probability, hard.probability, atol=1e-6)


def test_files_give_the_same_map_to_the_last_bit(
    make: Callable[[Classes], SerialisableMap], corner: LabelledCloud, tmp_path: Path
) -> None:
    semantic_map = built(make, corner)
    semantic_map.up = "-x"
    before = semantic_map.query(corner.points)
    save_map(semantic_map, tmp_path / "corner.semgp")
    loaded = load_map(tmp_path / "corner.semgp")
    after = loaded.query(corner.points)
    assert type(loaded) is type(semantic_map)
    assert (loaded.classes, loaded.up) == (semantic_map.classes, "-x")
    assert len(loaded) == len(semantic_map)
    np.testing.assert_array_equal(after.probability, before.probability)
    np.testing.assert_array_equal(after.observed, before.observed)
    if before.variance is not None and after.variance is not None:
        np.testing.assert_array_equal(after.variance, before.variance)
    loaded.update(corner)  # and it goes on living
    assert len(loaded) >= len(semantic_map)


def test_utm_coordinates_keep_their_digits(
    make: Callable[[Classes], SerialisableMap], corner: LabelledCloud
) -> None:
    if make is MAKERS["octomap"]:
        pytest.skip("OctoMap's keys reach 32,768 voxels from the origin; tests/octomap checks its error")
    shift = np.array([500_000.0, 5_000_000.0, 256.0])  # whole cells of the block map
    T = np.eye(4)
    T[:3, 3] = corner.T_world_sensor[:3, 3] + shift  # type: ignore[index]
    moved = replace(corner, points=corner.points + shift, T_world_sensor=T)
    here, there = built(make, corner).query(corner.points), built(make, moved).query(moved.points)
    np.testing.assert_allclose(there.probability, here.probability, atol=1e-4)


def test_duplicate_points_do_no_harm(make: Callable[[Classes], SerialisableMap], corner: LabelledCloud) -> None:
    prediction = built(make, corner, corner, corner).query(corner.points)
    assert np.isfinite(prediction.probability).all()


def test_a_single_class_is_a_map(make: Callable[[Classes], SerialisableMap], corner: LabelledCloud) -> None:
    floor = corner[corner.hard_labels == 0]
    assert (built(make, floor).query(floor.points).label == 0).all()


def test_positions_say_where_the_data_are(
    make: Callable[[Classes], SerialisableMap], corner: LabelledCloud
) -> None:
    positions = built(make, corner).positions
    nearest = np.linalg.norm(positions[:, None] - corner.points[None], axis=2).min(axis=1)
    assert len(positions) > 0
    assert nearest.max() < 0.5


def test_info_is_ready_for_json(make: Callable[[Classes], SerialisableMap], corner: LabelledCloud) -> None:
    import json

    semantic_map = built(make, corner)
    semantic_map.query(corner.points[:1])
    facts = json.loads(json.dumps(semantic_map.info(), allow_nan=False))
    assert facts["kind"] == semantic_map.kind
    assert facts["memory_bytes"] > 0


class TestBadInput:
    def test_a_map_without_labels_says_so(
        self, make: Callable[[Classes], SerialisableMap], corner: LabelledCloud
    ) -> None:
        unlabelled = replace(corner, labels=np.full(len(corner), MISSING))
        for semantic_map in (make(corner.classes), built(make, corner[:0])):
            with pytest.raises(InputError, match="no label"):
                semantic_map.query(corner.points)
        if make in (MAKERS["gp, free space"], MAKERS["gp, forgetting"]):  # rays need no labels
            assert (built(make, unlabelled).query(corner.points).label == MISSING).all()
        else:
            with pytest.raises(InputError, match="no label"):
                built(make, unlabelled).query(corner.points)

    def test_other_classes(self, make: Callable[[Classes], SerialisableMap], corner: LabelledCloud) -> None:
        with pytest.raises(InputError, match="classes"):
            make(Classes(("road", "car"))).update(corner)

    @pytest.mark.parametrize(
        "bad", [np.full((2, 3), np.nan), np.full((2, 3), np.inf), np.zeros((3, 2)), np.zeros(3)]
    )
    def test_query_points(
        self, make: Callable[[Classes], SerialisableMap], corner: LabelledCloud, bad: np.ndarray
    ) -> None:
        with pytest.raises(InputError, match="query points"):
            built(make, corner).query(bad)

    def test_no_query_points_is_no_error(
        self, make: Callable[[Classes], SerialisableMap], corner: LabelledCloud
    ) -> None:
        assert len(built(make, corner).query(np.empty((0, 3)))) == 0

    def test_damaged_files_are_refused(
        self, make: Callable[[Classes], SerialisableMap], corner: LabelledCloud, tmp_path: Path
    ) -> None:
        path = tmp_path / "map.semgp"
        semantic_map = built(make, corner)
        semantic_map.query(corner.points[:1])
        save_map(semantic_map, path)
        whole = path.read_bytes()
        rng = np.random.default_rng(0)
        for cut in rng.integers(0, len(whole), 15):
            path.write_bytes(whole[:cut])
            with pytest.raises(FileFormatError, match=r"map\.semgp"):
                load_map(path)
        for at in rng.integers(0, len(whole), 15):
            path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
            try:
                load_map(path)
            except FileFormatError:
                continue
