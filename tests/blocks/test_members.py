"""Layouts and members of blocks; each site has a class of its own, so that masses tell who is in which member."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.accumulate import MASS_UNIT
from semgp.blocks.cells import CELL
from semgp.blocks.layout import COARSE_BITS, Layout, lay_out, neighbours
from semgp.blocks.members import Members, Sizes, gather
from semgp.blocks.observations import Observations
from semgp.blocks.sites import Sites
from semgp.blocks.tree import split
from tests.blocks.naive import Array, Ints, featureless, voxel_index

RESOLUTION = 0.25
EDGE = CELL * RESOLUTION
MIDDLE = 13


class Scene(NamedTuple):
    sites: Sites
    layout: Layout
    around: NDArray[np.int32]
    position: Array  # of each site, from the lowest corner of the first cell


def scene(seed: int, n: int) -> Scene:
    """Sites in eight cells round a corner, in clumps; each site a class of its own."""
    rng = np.random.default_rng(seed)
    clumps = rng.uniform(-7, 7, (n // 12 + 1, 3)) * (1, 1, 0.3)
    points = clumps[rng.integers(0, len(clumps), n)] + rng.normal(scale=0.6, size=(n, 3)) + EDGE
    points = points[np.unique(np.floor(points / RESOLUTION), axis=0, return_index=True)[1]]
    sites = Sites(len(points), 0, RESOLUTION)
    labels = np.arange(len(points), dtype=np.int32)
    sites.add(Observations(points, labels, None, featureless(len(points))))
    cells = np.argsort(sites.cells.keys).astype(np.int32)
    layout = lay_out(sites, cells)
    place = np.full(len(cells) + 1, -1, np.int32)
    place[cells] = np.arange(len(cells))
    return Scene(sites, layout, place[neighbours(sites, cells)], sites.positions)


def cell_corner(s: Scene, i: int) -> Array:
    origin = s.sites.origin
    assert origin is not None
    return np.asarray((voxel_index(s.sites.cells.keys[s.layout.cells[i : i + 1]])[0] + origin) * RESOLUTION)


@pytest.mark.parametrize("seed", [0, 1])
def test_layout(seed: int) -> None:
    s = scene(seed, 500)
    layout, key = s.layout, voxel_index(s.sites.voxels.keys)
    assert sorted(layout.row.tolist()) == list(range(len(s.sites)))
    assert (np.diff(s.sites.cells.keys[layout.cells]) > 0).all()
    for i in range(len(layout.cells)):
        a, b = layout.start[i : i + 2]
        rows = layout.row[a:b]
        np.testing.assert_allclose(layout.X[a:b], s.position[rows] - cell_corner(s, i), atol=2e-6)
        first = layout.first[a + i : a + i + layout.n_coarse[i] + 1]
        assert (first[0], first[-1]) == (a, b)
        coarse = (key[rows] >> COARSE_BITS).tolist()
        groups = [coarse[begin - a : end - a] for begin, end in pairwise(first)]
        assert all(g.count(g[0]) == len(g) > 0 for g in groups)
        assert len({tuple(g[0]) for g in groups}) == len(groups)
        for k, (begin, end) in enumerate(pairwise(first)):
            np.testing.assert_allclose(layout.centre[a + k], layout.X[begin:end].mean(axis=0), atol=2e-6)


def test_layout_does_not_depend_on_the_order_of_points() -> None:
    rng = np.random.default_rng(3)
    points, labels = rng.uniform(0, 20, (400, 3)), rng.integers(0, 3, 400).astype(np.int32)
    made = []
    for order in (np.arange(400), np.concatenate([[0], 1 + rng.permutation(399)])):
        sites = Sites(3, 0, RESOLUTION)
        sites.add(Observations(points[order], labels[order], None, featureless(400)))
        made.append(lay_out(sites, np.argsort(sites.cells.keys).astype(np.int32)))
    for name in ("start", "X", "first", "n_coarse", "centre"):
        a, b = getattr(made[0], name), getattr(made[1], name)
        if name in ("first", "centre"):  # each cell's tail is not filled
            extra = int(name == "first")
            ranges = enumerate(zip(made[0].start, made[0].n_coarse))
            rows = np.concatenate([np.arange(n + extra) + t + i * extra for i, (t, n) in ranges])
            a, b = a[rows], b[rows]
        np.testing.assert_array_equal(a, b)


def test_neighbours() -> None:
    s = scene(0, 300)
    index = voxel_index(s.sites.cells.keys) // CELL
    around = neighbours(s.sites, np.arange(len(index), dtype=np.int32))
    offsets = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
    for i, row in enumerate(around):
        for at, cell in zip(index[i] + offsets, row):
            match = np.flatnonzero((index == at).all(axis=1))
            assert cell == (match[0] if len(match) else -1)


SIZES = [(8, 4, 6), (48, 16, 32), (5, 0, 7), (6, 30, 1), (4, 2, 0), (3, 0, 0), (40, 400, 20)]


@pytest.mark.parametrize(("leaf", "near", "far"), SIZES)
def test_members(leaf: int, near: int, far: int) -> None:
    s = scene(leaf, 350)
    layout, sizes = s.layout, Sizes(leaf, far, leaf + near + far)
    marks, mark = np.full(len(layout.row), -1, np.int32), 0
    C, room = len(s.sites), 4 * sizes.total + 1
    for i in range(len(layout.cells)):
        for own in (*_leaves(layout, i, leaf), np.empty(0, np.int64)):
            out = Members(
                *(np.full(shape, np.nan, np.float32) for shape in ((3, room), (0, room), (room, C), room))
            )
            n = gather(layout, s.around[i], own, EDGE, sizes, marks, mark, out)
            mark += 1
            assert n <= sizes.total
            _check(s, i, own, sizes, n, out)


def _leaves(layout: Layout, i: int, leaf: int) -> list[Ints]:
    a, b = layout.start[i : i + 2]
    n = max(1, -(-int(b - a) // leaf))
    order, bounds = np.empty(b - a, np.int64), np.empty(n + 1, np.int64)
    split(layout.X[a:b], order, n, np.empty(n - 1, np.int8), np.empty(n - 1, np.float32), bounds)
    return [order[bounds[k] : bounds[k + 1]] + a for k in range(n)]


def _check(s: Scene, i: int, own: Ints, sizes: Sizes, n: int, out: Members) -> None:
    mass, k = out.mass[:n], out.k[:n]
    assert set(np.unique(mass).tolist()) <= {0.0, 1.0}  # of one label each: nothing is added twice
    assert MASS_UNIT * s.layout.unit == 1
    assert mass.sum(axis=0).max() <= 1  # no site twice
    np.testing.assert_array_equal(k, mass.sum(axis=1))
    who = [np.flatnonzero(row) for row in mass]  # a site's class is its row
    local = s.position - cell_corner(s, i)
    means = np.array([local[sites].mean(axis=0) for sites in who]).reshape(-1, 3)
    np.testing.assert_allclose(out.X[:, :n].T, means, atol=1e-5)
    assert [w.tolist() for w in who[: len(own)]] == [[row] for row in s.layout.row[own]]

    # coarse voxels in the order in which their first members come
    voxel = voxel_index(s.sites.voxels.keys) >> COARSE_BITS
    coarse = [tuple(voxel[sites[0]].tolist()) for sites in who[len(own) :]]
    assert all((voxel[sites] == voxel[sites[0]]).all() for sites in who)
    met = list(dict.fromkeys(coarse))
    box = local[s.layout.row[own]] if len(own) else np.array([[0, 0, 0], [EDGE, EDGE, EDGE]])
    groups: dict[tuple[int, ...], list[int]] = {}
    cells = s.layout.cells[s.around[i][s.around[i] >= 0]]
    near_by = np.isin(s.sites._cell[: len(s.sites)], cells)
    for row in np.flatnonzero(near_by):
        groups.setdefault(tuple(voxel[row].tolist()), []).append(int(row))
    gap = {g: _gap(local[rows].mean(axis=0), box) for g, rows in groups.items()}
    distances = np.array([gap[g] for g in met])
    assert (np.diff(distances) > -1e-4).all()  # nearest first
    used = {int(r) for sites in who for r in sites}
    for g in met:
        assert used >= set(groups[g])  # one voxel is taken whole
    singles = sum(len(w) == 1 for w in who) - len(own)
    joined = n - len(own) - singles
    assert joined <= sizes.far
    if joined == 0 and n < sizes.total - sizes.far and len(groups) <= sizes.total:
        assert len(used) == near_by.sum()  # room left: everyone is in
    left_out = [gap[g] for g in groups if not used & set(groups[g]) and gap[g] < EDGE / 4]
    if left_out:
        assert min(left_out) > distances.max(initial=0) - 1e-4


def _gap(x: Array, box: Array) -> float:
    return float(np.linalg.norm(np.maximum(np.maximum(box.min(axis=0) - x, x - box.max(axis=0)), 0)))
