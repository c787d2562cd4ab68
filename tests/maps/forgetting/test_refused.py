"""Clouds and files that a map which forgets refuses."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.model import BlockModel
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.maps.files import load_map, save_map
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from tests.maps.forgetting.scenes import EDGE, MODEL, SENSOR, TWO, new, off, scan, updated


class TestRefused:
    """Updates that are refused leave a map as it was, the time included."""

    def untouched(self, made: GPSemanticMap, cloud: LabelledCloud, message: str) -> None:
        before = {name: a.copy() for name, a in made.to_arrays()[1].items()}
        with pytest.raises(InputError, match=message):
            made.update(cloud)
        now = made.to_arrays()[1]
        assert now.keys() == before.keys()
        for name in now:
            np.testing.assert_array_equal(now[name], before[name], err_msg=name)

    def test_clouds_without_a_stamp(self) -> None:
        made = new(Forgetting(5.0, per="second"))
        self.untouched(made, scan(), "needs a stamp")
        self.untouched(updated(made, scan(stamp=3.0)), scan(), "needs a stamp")

    def test_clouds_out_of_order(self) -> None:
        made = updated(new(Forgetting(5.0, per="second")), scan(stamp=3.0), scan(stamp=3.0))
        self.untouched(made, scan(stamp=2.9), "in their order")

    def test_a_first_cloud_may_have_any_stamp(self) -> None:
        assert len(updated(new(Forgetting(5.0, per="second")), scan(stamp=-3.0), scan(stamp=-1.0))) > 0

    def test_scans_need_no_stamps(self) -> None:
        assert len(updated(new(Forgetting(5.0)), scan(stamp=3.0), scan(), scan(stamp=1.0))) > 0

    def test_clouds_without_a_pose(self) -> None:
        self.untouched(updated(new(Forgetting(5.0)), scan(0.0)), scan(T_world_sensor=None), "give its pose")

    def test_stray_points(self) -> None:
        stray = scan()
        stray.points[0] += 2e5
        self.untouched(updated(new(Forgetting(5.0)), scan(0.0)), stray, "drop stray points")

    def test_heavy_labels(self) -> None:
        heavy = scan(labels=None, weights=np.full((2500, 2), 65.0))
        self.untouched(updated(new(Forgetting(5.0)), scan(0.0)), heavy, "64 at most")

    def test_uncertain_positions_for_experts(self) -> None:
        model = BlockModel(resolution=EDGE, posterior="dirichlet")
        made = GPSemanticMap(TWO, model, free=FreeSpace(), forgetting=Forgetting(5.0))
        uncertain = scan(covariances=np.tile(np.eye(3) * 1e-4, (2500, 1, 1)))
        self.untouched(updated(made, scan(0.0)), uncertain, "take positions as certain")

    @pytest.mark.parametrize("stamp", [np.nan, np.inf])
    def test_stamps_that_are_none(self, stamp: float) -> None:
        with pytest.raises(InputError, match="stamp"):
            scan(stamp=stamp)

    @pytest.mark.parametrize("per", ["scan", "second"])
    def test_empty_clouds_take_no_time(self, per: str) -> None:
        made = updated(new(Forgetting(5.0, per)), scan(0.0, stamp=1.0))
        before = {name: a.copy() for name, a in made.to_arrays()[1].items()}
        updated(made, scan(stamp=9.0)[:0], scan()[:0])
        for name, array in made.to_arrays()[1].items():
            np.testing.assert_array_equal(array, before[name], err_msg=name)

    @pytest.mark.parametrize("damage", ["nan", "inf", "later than now", "cells twice", "no cells", "origins"])
    def test_damaged_files(self, damage: str, tmp_path: Path) -> None:
        made = updated(new(Forgetting(5.0)), scan(0.0), scan(sensor=off(SENSOR, 20, 0, 0)))

        class Damaged(GPSemanticMap):
            def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
                header, arrays = made.to_arrays()
                time, cells = arrays["time"].copy(), arrays["cells"].copy()
                if damage == "nan":
                    time[0] = np.nan
                elif damage == "inf":
                    time[-1] = np.inf
                elif damage == "later than now":
                    time[0] = time[-1] + 1
                elif damage == "cells twice":
                    cells[1:] = cells[0]
                elif damage == "no cells":
                    cells += 5
                else:
                    arrays["free.origin"] = arrays["free.origin"] + 64
                return header, arrays | {"time": time, "cells": cells}

        save_map(Damaged(TWO, MODEL), tmp_path / "map.semgp")
        with pytest.raises(FileFormatError, match="damaged"):
            load_map(tmp_path / "map.semgp")

    @pytest.mark.parametrize("name", ["time", "cells", "free.time"])
    def test_files_that_lack_something(self, name: str, tmp_path: Path) -> None:
        made = updated(new(Forgetting(5.0)), scan(0.0), scan())
        header, arrays = made.to_arrays()
        wrong: dict[str, NDArray[Any]] = {"time": arrays["time"][1:], "cells": arrays["cells"].astype(float)}
        wrong["free.time"] = arrays["free.time"].astype(int)
        with pytest.raises(InputError, match=name):
            GPSemanticMap.from_arrays(TWO, header, arrays | {name: wrong[name]})
