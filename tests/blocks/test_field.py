"""Fields in use: what is solved again when, what is kept, and that no history shows in the answers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from semgp.blocks.answer import Answers
from semgp.blocks.cells import CELL
from semgp.blocks.field import Field
from semgp.blocks.model import BlockModel
from semgp.blocks.observations import Observations
from semgp.blocks.store import sorted_by
from semgp.errors import InputError
from tests.blocks.naive import Array, Ints, featureless, filled, piece_of, street, voxel_index

MODEL = BlockModel(leaf=12, near=6, far=8)
EDGE = CELL * MODEL.resolution


def assert_same(a: Answers, b: Answers) -> None:
    for x, y in zip(a, b, strict=True):
        np.testing.assert_array_equal(x, y)


@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.booleans())
@example(1858992, 1, True)  # a point with three blocks, whose numbers the query before has changed
@settings(deadline=None, max_examples=12)
def test_updates_in_any_order_give_the_bits_of_one_update(seed: int, n_updates: int, ask_between: bool) -> None:
    rng = np.random.default_rng(seed)
    points, labels = street(seed % 1000, 600, 3)
    queries = points[:100] + rng.normal(scale=0.1, size=(100, 3))
    at_once, step_by_step = filled(MODEL, points, labels, 3), Field(MODEL, 3)
    for part in np.array_split(rng.permutation(600), n_updates):
        step_by_step.add(Observations(points[part], labels[part], None, featureless(len(part))))
        if ask_between:
            step_by_step.query(queries[:10], featureless(10))
    assert_same(step_by_step.query(queries, featureless(100)), at_once.query(queries, featureless(100)))


def test_only_stale_cells_are_solved() -> None:
    """Cells in a row, one site each: an update reaches its cell and those next to it."""
    points = np.array([[i * EDGE + 1.0, 1.0, 1.0] for i in range(8)])
    field = filled(MODEL, points, np.zeros(8, np.int32), 2)
    assert field.solve() == 8
    assert field.solve() == 0
    field.add(Observations(points[3:4] + 0.5, np.ones(1, np.int32), None, featureless(1)))
    before = field.store.next_block
    assert field.store.stale.sum() == 3
    field.query(points[6:8], featureless(2))  # up to date already
    assert field.store.next_block == before
    assert field.solve(np.array([3], np.int32)) == 1
    assert field.solve() == 2


def test_a_query_solves_what_it_needs() -> None:
    points = np.array([[i * EDGE + 1.0, 1.0, 1.0] for i in range(8)])
    field = filled(MODEL, points, np.zeros(8, np.int32), 2)
    field.query(points[2:3], featureless(1))
    assert field.store.stale.sum() == 7
    field.query(
        points[2:3] + np.array([0, EDGE, 0]), featureless(1)
    )  # a cell without sites beside one that has some
    assert (field.store.stale.sum(), len(field.sites.cells)) == (7, 9)
    field.query(points[2:3] + np.array([0, 3 * EDGE, 0]), featureless(1))
    assert len(field.sites.cells) == 9


def test_a_cell_without_sites_answers_from_those_round_about() -> None:
    model = replace(MODEL, blend=0.01)
    edge, step = np.array([[1.0, EDGE - 0.03, 1.0]]), np.array([0, 0.06, 0])
    field = filled(model, edge, np.zeros(1, np.int32), 2)
    beyond = edge + step
    inside = edge - step
    answers = field.query(np.concatenate([beyond, inside]), featureless(2))
    np.testing.assert_allclose(answers.probability[0], answers.probability[1], atol=2e-3)
    # once it has sites, it answers from them as well
    field.add(Observations(beyond, np.ones(1, np.int32), None, featureless(1)))
    again = filled(model, np.concatenate([edge, beyond]), np.array([0, 1], np.int32), 2)
    assert_same(field.query(beyond, featureless(1)), again.query(beyond, featureless(1)))


def walked(n_updates: int) -> tuple[Field, Array]:
    """A short walk back and forth, with a query after each update."""
    rng = np.random.default_rng(1)
    field = Field(MODEL, 2)
    for i in range(n_updates):
        centre = (6 + 5 * np.sin(i / 3), 2.0, 1.0)
        points = centre + rng.uniform(-1, 1, (60, 3)) * (1, 1, 0.1)
        field.add(Observations(points, rng.integers(0, 2, 60).astype(np.int32), None, featureless(60)))
        field.query(points[:5], featureless(5))
    return field, points


def test_store_stays_small_over_many_updates() -> None:
    field, points = walked(60)
    field.solve()
    store = field.store
    fresh = Field(MODEL, 2)
    fresh.sites.restore(field.sites.to_arrays())
    fresh.touch(np.arange(len(fresh.sites.cells), dtype=np.int32))
    fresh.solve()
    assert len(store.pieces) <= len(field.sites.cells)
    assert store.next_block > 5 * store.n_blocks  # most blocks that there were are gone
    trees = store.trees(field.sites.cells)
    assert len(trees.axes) == len(trees.cuts) <= 3 * (store.n_blocks + 1)
    assert sum(p.cells for p in store.pieces.values()) == np.count_nonzero(trees.block >= 0)
    assert store.n_bytes <= 4 * fresh.store.n_bytes
    assert_same(field.query(points, featureless(60)), fresh.query(points, featureless(60)))


def test_blocks_have_numbers_of_their_own() -> None:
    field, _ = walked(12)
    field.solve()
    trees = field.store.trees(field.sites.cells)
    used = np.concatenate([np.arange(n) + b for b, n in zip(trees.block, trees.leaves) if b >= 0])
    assert len(set(used.tolist())) == len(used) == field.store.n_blocks
    places = set()
    for number in used:
        piece, place = piece_of(field, int(number))
        assert 0 <= place < len(piece.solved.n)
        places.add((piece.first, place))
    assert len(places) == len(used)
    sites_of = np.bincount(field.sites._cell[: len(field.sites)], minlength=len(trees.leaves))
    assert (sites_of <= trees.leaves * MODEL.leaf).all()


def solved_again(field: Field) -> None:
    field.touch(np.arange(len(field.sites.cells), dtype=np.int32))
    field.solve()


@pytest.mark.parametrize(
    "model", [MODEL, replace(MODEL, near=0, far=30), replace(MODEL, posterior="vote")], ids=str
)
def test_memory_of_dropped_pieces_is_used_again(model: BlockModel) -> None:
    """Full of numbers that are none: what was there before does not show."""
    points, labels = street(6, 900, 3)
    queries = points[:150] + 0.02
    field = filled(model, points, labels, 3)
    expected = field.query(queries, featureless(150))
    field.solve()
    solved_again(field)
    spare = list(field.store._spare)
    for array in spare:
        array[:] = np.nan
    solved_again(field)
    used = [p.solved.factor for p in field.store.pieces.values()]
    if model.solves:
        assert any(np.shares_memory(a, b) for a in spare for b in used)
    assert not any(np.shares_memory(a, b) for i, a in enumerate(used) for b in used[:i])  # no two share any
    assert not any(np.shares_memory(a, b) for a in used for b in field.store._spare)
    assert_same(field.query(queries, featureless(150)), expected)
    # as the map grows, pieces need rooms of other sizes
    for seed in (7, 8, 9):
        more, more_labels = street(seed, 500, 3)
        field.add(Observations(more, more_labels, None, featureless(500)))
        for array in field.store._spare:
            array[:] = np.nan
        points, labels = np.concatenate([points, more]), np.concatenate([labels, more_labels])
        fresh = filled(model, points, labels, 3)
        assert_same(field.query(queries, featureless(150)), fresh.query(queries, featureless(150)))
    assert len(field.store._spare) <= 65


def test_rooms_are_large_enough_and_not_much_larger() -> None:
    store = Field(MODEL, 2).store
    store._spare = [np.zeros(n, np.float32) for n in (10, 25, 100)]
    assert [len(store.room(n)) for n in (20, 20, 60, 5, 5)] == [25, 20, 100, 10, 5]
    assert store._spare == []


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 3, 2**16, 2**17, 2**40]), st.integers(0, 400))
@settings(deadline=None, max_examples=60)
def test_sorted_by_is_a_stable_sort(seed: int, most: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    number = rng.integers(-1, most, n)
    before = number.copy()
    np.testing.assert_array_equal(sorted_by(number), np.argsort(number, kind="stable"))
    np.testing.assert_array_equal(number, before)


def parts_by_piece(field: Field, block: Ints) -> list[Ints]:
    """Check the parts, and return them: each of one piece, in order of its blocks."""
    parts = []
    for piece, order, place in field.store.by_piece(block):
        assert len(order)
        mine = block[order]
        if piece is None:
            np.testing.assert_array_equal(mine, -1)
        else:
            assert ((place >= 0) & (place < len(piece.solved.n))).all()
            np.testing.assert_array_equal(np.diff(place)[np.diff(mine) == 0], 0)
        rank = np.lexsort((order, mine))
        np.testing.assert_array_equal(rank, np.arange(len(order)))  # ties as they came
        parts.append(order)
    return parts


def test_pairs_by_piece() -> None:
    field, _ = walked(12)
    field.solve()
    trees = field.store.trees(field.sites.cells)
    used = np.concatenate([np.arange(n) + b for b, n in zip(trees.block, trees.leaves) if b >= 0])
    assert len(field.store.pieces) > 2
    for seed, n in enumerate((0, 1, 7, 500)):
        rng = np.random.default_rng(seed)
        for block in (rng.choice(np.append(used, -1), n), rng.choice(used, n), np.full(n, -1)):
            parts = parts_by_piece(field, block)
            assert sorted(np.concatenate([*parts, np.empty(0, np.int64)]).tolist()) == list(range(n))
    assert len(parts_by_piece(field, used)) >= len(field.store.pieces)
    assert len(parts_by_piece(field, np.append(used, -1))) == len(parts_by_piece(field, used)) + 1


def test_tolerance_leaves_what_has_hardly_changed() -> None:
    points, labels = street(3, 800, 2)
    field = filled(MODEL, points, labels, 2)
    field.solve()
    field.add(Observations(points[:3], labels[:3], None, featureless(3)))
    assert field.store.stale.any()
    assert field.solve(tolerance=0.2) == 0
    more, labels = street(4, 800, 2)
    field.add(Observations(more, labels, None, featureless(800)))
    assert field.solve(tolerance=0.2) > 0
    assert field.solve() >= 0
    both = np.concatenate([points, points[:3], more])
    again = filled(MODEL, both, np.concatenate([street(3, 800, 2)[1], street(3, 800, 2)[1][:3], labels]), 2)
    assert_same(field.query(points[:50], featureless(50)), again.query(points[:50], featureless(50)))


@pytest.mark.parametrize("shift", [-5e6, 5e6])
def test_far_from_the_world_s_origin(shift: float) -> None:
    """Whole cells away, the same map up to the rounding of coordinates of 5000 km."""
    points, labels = street(5, 500, 3)
    whole = np.round(shift / EDGE) * EDGE
    here, there = filled(MODEL, points, labels, 3), filled(MODEL, points + whole, labels, 3)
    assert (np.sort(voxel_index(here.sites.cells.keys), axis=0).shape) == (len(there.sites.cells), 3)
    a = here.query(points[:200], featureless(200))
    b = there.query(points[:200] + whole, featureless(200))
    np.testing.assert_allclose(a.probability, b.probability, atol=2e-3)


def test_nothing_to_solve() -> None:
    assert Field(MODEL, 2).solve() == 0


def test_a_model_for_other_classes_is_refused() -> None:
    with pytest.raises(InputError, match="3 classes, the map has 2"):
        Field(replace(MODEL, prior=(0.5, 0.25, 0.25)), 2)
