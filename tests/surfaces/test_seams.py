"""Bricks of a lattice: their seams leave no trace."""

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.surfaces import lattice
from semgp.surfaces.contour import Sheet, contour
from semgp.surfaces.evidence import REACH
from semgp.voxels import VoxelTable, voxel_keys
from tests.surfaces.meshes import assert_watertight, needs_extra, quiet

pytestmark = quiet


@needs_extra
class TestSeams:
    @pytest.mark.parametrize("seed", range(4))
    def test_any_signs_and_ties_give_closed_surfaces(self, seed: int) -> None:
        on = np.random.default_rng(seed).random((13, 13, 13)) < 0.4
        dense = -np.ones((16, 16, 16), dtype=np.float32)
        dense[1:14, 1:14, 1:14] = np.where(on, 1, -1)
        sheet = contour(*in_bricks(dense, 4))
        assert_watertight(sheet.faces)
        assert len(np.unique(sheet.vertices, axis=0)) == len(sheet.vertices)

    @pytest.mark.parametrize("seed", range(3))
    def test_faces_at_unknown_nodes_are_dropped_and_no_others(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        dense = rng.normal(size=(16, 16, 16)).astype(np.float32)
        unknown = rng.random(dense.shape) < 0.02
        full = contour(*in_bricks(np.where(unknown, np.float32(-1), dense), 4))
        holed = contour(*in_bricks(np.where(unknown, np.float32(np.nan), dense), 4))
        low, high = np.floor(full.vertices).astype(int), np.ceil(full.vertices).astype(int)
        meets_unknown = unknown[*low.T] | unknown[*high.T]
        expected = full.only(np.logical_not(meets_unknown))
        assert 0 < len(holed.faces) < len(full.faces)
        assert corners_of(holed) == corners_of(expected)

    @pytest.mark.parametrize("cells", [1, 3, 8])
    def test_every_node_near_by_is_there_once(self, cells: int, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(lattice, "CELLS", cells)
        positions = np.random.default_rng(0).uniform(-0.5, 0.5, (12, 3)) * (1, 1, 0.3)
        found = lattice.lattice_near(positions, 0.07, 0.05, lattice.box_between((-9, -9, -0.3), None))
        nodes = np.round(found.nodes(slice(0, len(found))) / 0.07 - 0.5).astype(int)
        index = np.stack(np.meshgrid(*[np.arange(-16, 16)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        X = (index + 0.5) * 0.07
        away = np.abs(X[:, None] - positions).max(axis=2).min(axis=1)
        wanted = index[(away <= REACH * 0.07 + 0.07) & (X[:, 2] >= -0.3)]
        as_set = set(map(tuple, nodes.tolist()))
        assert len(as_set) == len(nodes)
        assert as_set >= set(map(tuple, wanted.tolist()))
        assert len(nodes) < len(wanted) * (1 + 2 * cells / 11) ** 3

    def test_the_inner_node_is_inside(self) -> None:
        dense = np.random.default_rng(0).normal(size=(8, 8, 8)).astype(np.float32)
        sheet = contour(*in_bricks(dense, 4))
        assert (dense[*sheet.inner.astype(int).T] > 0).all()
        assert (np.abs(sheet.inner - sheet.vertices).max(axis=1) < 1).all()


def in_bricks(dense: NDArray[np.float32], cells: int) -> tuple[lattice.Lattice, NDArray[np.float32]]:
    """Return an array as a lattice with nodes one metre apart, and its values."""
    n = len(dense) // cells
    starts = np.array(list(itertools.product(range(n), repeat=3)))
    bricks = VoxelTable()
    bricks.insert(voxel_keys(starts + 0.5, 1.0))
    values = [dense[x : x + cells, y : y + cells, z : z + cells] for x, y, z in starts * cells]
    return lattice.Lattice(1.0, cells, np.zeros(3, dtype=np.int64), bricks), np.array(values)


def corners_of(sheet: Sheet) -> set[bytes]:
    return {np.sort(sheet.edges[face]).tobytes() for face in sheet.faces}
