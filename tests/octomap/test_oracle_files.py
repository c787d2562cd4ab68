"""Files against OctoMap itself: the trees that one side wrote and the other reads."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semgp.octomap import SemanticOctoMap
from tests.octomap.oracle import CLASSES, assert_same_leaves, build, oracle, rows_of, rows_of_cells, synthetic

WHITE = (255, 255, 255)


class TestFiles:
    """The trees of files that one side wrote and the other reads."""

    @pytest.fixture
    def both(self) -> tuple[SemanticOctoMap, Any]:
        return build([synthetic(seed) for seed in range(4)], 0.1)

    def test_ot_to_octomap(self, both: tuple[SemanticOctoMap, Any], tmp_path: Path) -> None:
        ours, theirs = both
        ours.write(tmp_path / "map.ot")
        read = oracle.OcTree.read(str(tmp_path / "map.ot").encode())
        assert read.size() == theirs.size()
        assert_same_leaves(ours.leaves(), read, 0.1)
        assert (tmp_path / "map.ot").read_bytes() == theirs.write()  # to the last byte

    def test_bt_to_octomap(self, both: tuple[SemanticOctoMap, Any], tmp_path: Path) -> None:
        ours, theirs = both
        ours.write(tmp_path / "map.bt")
        read = oracle.OcTree(0.5)
        assert read.readBinary(str(tmp_path / "map.bt").encode())
        written = theirs.writeBinary()  # which makes the oracle's tree binary, too
        assert (tmp_path / "map.bt").read_bytes() == written
        np.testing.assert_array_equal(rows_of(read, 0.1), rows_of(theirs, 0.1))
        assert read.getResolution() == 0.1

    def test_ot_from_octomap(self, both: tuple[SemanticOctoMap, Any], tmp_path: Path) -> None:
        ours, theirs = both
        assert theirs.write(str(tmp_path / "map.ot").encode())
        read = SemanticOctoMap.read(tmp_path / "map.ot", CLASSES)
        assert read.resolution == 0.1
        np.testing.assert_array_equal(rows_of_cells(read.leaves(), 0.1), rows_of_cells(ours.leaves(), 0.1))
        cloud = synthetic(7)
        ours.update(cloud)
        read.update(cloud)
        np.testing.assert_array_equal(read.leaves().log_odds, ours.leaves().log_odds)

    def test_bt_from_octomap(self, both: tuple[SemanticOctoMap, Any], tmp_path: Path) -> None:
        _, theirs = both
        assert theirs.writeBinary(str(tmp_path / "map.bt").encode())
        read = SemanticOctoMap.read(tmp_path / "map.bt", CLASSES)
        assert_same_leaves(read.leaves(), theirs, 0.1)

    def test_unpruned_ot_from_octomap(self, tmp_path: Path) -> None:
        ours, theirs = build([synthetic(seed) for seed in range(3)], 0.1, lazy_eval=True)
        assert theirs.write(str(tmp_path / "map.ot").encode())
        read = SemanticOctoMap.read(tmp_path / "map.ot", CLASSES)
        np.testing.assert_array_equal(rows_of_cells(read.leaves(), 0.1), rows_of_cells(ours.leaves(), 0.1))

    @pytest.mark.parametrize("colours", ["mean", "class"])
    def test_coloured_ot_to_octomap_and_back(self, colours: Any, tmp_path: Path) -> None:
        ours, theirs = build([synthetic(seed) for seed in range(4)], 0.1)
        ours.write(tmp_path / "map.ot", colours)
        tree = oracle.ColorOcTree.read(str(tmp_path / "map.ot").encode())
        n_coloured = 0
        for leaf in tree.begin_leafs():
            centre, colour = np.asarray([leaf.getCoordinate()]), tuple(leaf.getColor())
            expected = WHITE
            if leaf.getValue() >= 0:
                assert round(leaf.getSize() / 0.1) == 1
                if colours == "mean":
                    mean, known = ours.query_colours(centre)
                    expected = tuple(mean[0].tolist()) if known[0] else WHITE
                else:
                    label = int(ours.query(centre).label[0])
                    expected = CLASSES.colours[label] if label >= 0 else WHITE
            assert colour == expected
            n_coloured += colour != WHITE
        assert n_coloured > 100
        assert tree.search(np.zeros(3), 1).getLogOdds() == theirs.search(np.zeros(3), 1).getLogOdds()
        before = tree.write()
        tree.updateInnerOccupancy()  # averages the colours of children, as the file already has it
        assert tree.write() == before
        read = SemanticOctoMap.read(tmp_path / "map.ot", CLASSES)
        np.testing.assert_array_equal(rows_of_cells(read.leaves(), 0.1), rows_of_cells(ours.leaves(), 0.1))
        if colours == "mean":
            points = ours.occupied(pruned=False).centres
            for found, expected_of in zip(read.query_colours(points), ours.query_colours(points)):
                np.testing.assert_array_equal(found, expected_of)
