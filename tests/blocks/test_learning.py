"""Learning by other scans' labels: patches are what they claim to be, and what is learned holds elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.draw import HELD_OUT, draw_patches
from semgp.blocks.field import Field
from semgp.blocks.inputs import add_cloud
from semgp.blocks.learning import class_frequencies, learn_blocks, learn_from_scans
from semgp.blocks.model import BlockModel
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.gp.stationary import Matern52
from tests.blocks.naive import featureless, leaf_boxes, piece_of

CLASSES = Classes(("road", "grass", "kerb"))
START = BlockModel(
    kernel=Matern52(ell=(0.1,), sf=0.3) + Matern52(ell=(0.4, 0.4, 0.4), sf=0.2),
    resolution=0.1, s_n=4.0, nugget=2.0, prior=(0.4, 0.4, 0.2),
)  # fmt: skip


def scan(seed: int, n: int = 900, shift: float = 0.0) -> LabelledCloud:
    """Road and grass in stripes of two metres with kerbs between; one label in five wrong, one in nine missing."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(0, 9, (n, 2)), rng.normal(scale=0.03, size=n)])
    along = points[:, 0] % 4
    labels = np.where(np.abs(along - 2) < 0.3, 2, along > 2)
    labels = np.where(rng.random(n) < 0.2, rng.integers(0, 3, n), labels)
    labels[rng.random(n) < 1 / 9] = -1
    return LabelledCloud(points + shift, CLASSES, labels)


def log_loss(model: BlockModel, training: list[LabelledCloud], judge: LabelledCloud) -> float:
    field = Field(model, len(CLASSES))
    for cloud in training:
        add_cloud(field, cloud)
    judge = judge[judge.labelled]
    p = field.query(judge.points, featureless(len(judge))).probability
    return float(-np.log(p[np.arange(len(judge)), judge.hard_labels]).mean())


class TestDraw:
    model = replace(START, leaf=16, near=6, far=8)

    @pytest.mark.parametrize("n", [1, 10, 3000])
    def test_patches_are_blocks_with_points_in_their_leaves(self, n: int) -> None:
        training, judges = [scan(0), scan(1)], [scan(2), scan(3, shift=0.01)]
        patches = draw_patches(self.model, training, judges, n, np.random.default_rng(0))
        field = Field(replace(self.model, posterior="vote", weights=None), 3)
        for cloud in training:
            add_cloud(field, cloud)
        field.solve()
        trees, edge = field.store.trees(field.sites.cells), 64 * self.model.resolution
        blocks = {}
        for cell, (first, leaves) in enumerate(zip(trees.block, trees.leaves)):
            a, b = trees.tree_at[cell], trees.tree_at[cell] + leaves - 1
            boxes = leaf_boxes(trees.axes[a:b], trees.cuts[a:b], leaves, np.zeros(3), np.full(3, edge))
            for k, box in enumerate(boxes):
                piece, at = piece_of(field, int(first) + k)
                blocks[piece.solved.X[at, :, : piece.solved.n[at]].tobytes()] = box
        assert 1 <= len(patches) <= n
        assert len({p.X.tobytes() for p in patches}) == len(patches)
        for patch in patches:
            low, high = blocks[patch.X.tobytes()]
            assert 1 <= len(patch.label) <= HELD_OUT
            inside = np.clip(patch.Y.T, low, high)
            np.testing.assert_allclose(patch.Y.T, inside, atol=1e-5)
            assert (patch.label >= 0).all()
            assert (patch.mass.sum(axis=1) > 0).all()
        if n == 3000:
            assert len(patches) > 0.9 * len(blocks)

    def test_no_judge_near_the_map(self) -> None:
        apart = [scan(1, shift=500.0)]
        assert draw_patches(self.model, [scan(0)], apart, 50, np.random.default_rng(0)) == []

    def test_held_out_points_are_the_judges_own(self) -> None:
        judge = scan(2)
        patches = draw_patches(self.model, [scan(0)], [judge], 100, np.random.default_rng(1))
        known = {(round(x, 4), round(y, 4)): c for (x, y, _), c in zip(judge.points % 6.4, judge.hard_labels)}
        for patch in patches:
            for y, label in zip(patch.Y.T.astype(np.float64), patch.label):
                near = [
                    (round(y[0], 4) + a, round(y[1], 4) + b) for a in (-1e-4, 0, 1e-4) for b in (-1e-4, 0, 1e-4)
                ]
                match = [known[key] for a, b in near if (key := (round(a, 4), round(b, 4))) in known]
                assert label in match


class TestScans:
    def test_learning_lowers_the_loss_of_a_scan_not_seen(self) -> None:
        scans, judge = [scan(s) for s in range(6)], scan(99)
        model, found = learn_from_scans(scans, START, patches=60, max_iterations=8)
        assert found.log_loss < found.start_log_loss + 1e-9
        assert found.patches > 20
        assert log_loss(model, scans, judge) < log_loss(START, scans, judge) - 0.02
        assert model.prior == pytest.approx(class_frequencies(scans))
        first, second = model.terms
        assert second.ell[0] == second.ell[1] != second.ell[2]
        assert len(first.ell) == 1
        for name in ("resolution", "posterior", "leaf", "near", "far", "blend", "features"):
            assert getattr(model, name) == getattr(START, name)

    def test_same_seed_same_model(self) -> None:
        scans = [scan(s, 300) for s in range(3)]
        found = [learn_from_scans(scans, START, patches=10, max_iterations=2, seed=s) for s in (4, 4, 5)]
        assert found[0] == found[1]
        assert found[0] != found[2]

    def test_one_scan_is_not_enough(self) -> None:
        unlabelled = LabelledCloud(np.zeros((3, 3)), CLASSES, np.full(3, -1, np.int32))
        for scans in ([], [scan(0)], [scan(0), unlabelled]):
            with pytest.raises(InputError, match="two with labels"):
                learn_from_scans(scans, START)

    def test_scans_apart_teach_nothing(self) -> None:
        with pytest.raises(InputError, match="nothing to learn from"):
            learn_from_scans([scan(0, 200), scan(1, 200, shift=300.0)], START, patches=5)

    def test_experts_are_refused(self) -> None:
        with pytest.raises(InputError, match="not learned by trials"):
            learn_from_scans([scan(0, 50), scan(1, 50)], BlockModel(posterior="laplace"))


class TestTrials:
    def test_true_labels_of_other_scenes(self) -> None:
        calls: list[float] = []
        trials = [([scan(0)], [scan(1)]), ([scan(2)], [scan(3)])]
        start = replace(START, prior=None)
        model, found = learn_blocks(
            trials, start, patches=30, max_iterations=4, progress=lambda _, value: calls.append(value)
        )
        assert found.log_loss < found.start_log_loss
        assert calls[0] == found.start_log_loss
        assert 1 <= found.iterations <= 4
        assert model.prior == pytest.approx(class_frequencies([scan(0), scan(2)]))

    def test_a_tight_prior_keeps_the_start(self) -> None:
        trials = [([scan(0, 300)], [scan(1, 300)])]
        model, _ = learn_blocks(trials, START, patches=8, max_iterations=3, spread=1e-4)
        np.testing.assert_allclose(model.kernel.theta, START.kernel.theta, atol=1e-3)

    @pytest.mark.parametrize(
        "trials", [[], [([], [scan(1, 50)])], [([scan(0, 50)], [])]], ids=["none", "map", "judge"]
    )
    def test_trials_without_clouds(self, trials: list[tuple[list[LabelledCloud], list[LabelledCloud]]]) -> None:
        with pytest.raises(InputError, match="a trial needs clouds"):
            learn_blocks(trials, START, patches=5)
        with pytest.raises(InputError, match="a trial needs clouds"):  # one whole trial does not help
            learn_blocks([([scan(0, 50)], [scan(1, 50)]), *(trials or [([], [])])], START, patches=5)

    @pytest.mark.parametrize("vertical", [3, -1])
    def test_a_vertical_that_is_no_axis(self, vertical: int) -> None:
        trials = [([scan(0, 50)], [scan(1, 50)])]
        with pytest.raises(InputError, match=f"not {vertical}"):
            learn_blocks(trials, START, vertical=vertical, patches=5)
        with pytest.raises(InputError, match=f"not {vertical}"):
            learn_from_scans([scan(0, 50), scan(1, 50)], START, vertical=vertical, patches=5)


def test_class_frequencies() -> None:
    clouds = [
        LabelledCloud(np.zeros((4, 3)), CLASSES, np.array([0, 0, 1, -1], np.int32)),
        LabelledCloud(np.zeros((1, 3)), CLASSES, weights=_half()),
    ]
    assert class_frequencies(clouds) == pytest.approx(np.array([3.0, 2.0, 0.5]) / 5.5)


def _half() -> NDArray[np.float32]:
    return np.array([[0.5, 0.5, 0.0]], dtype=np.float32)
