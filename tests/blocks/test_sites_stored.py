"""Sites are stored and restored, and damage is refused."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.accumulate import PLACE_UNIT
from semgp.blocks.observations import Observations
from semgp.blocks.sites import Sites
from semgp.errors import InputError
from tests.blocks.site_sums import made, voxels


class TestStored:
    def sites(self) -> Sites:
        rng = np.random.default_rng(2)
        weights = rng.random((200, 3)).astype(np.float32)
        return made(rng.uniform(-9, 9, (200, 3)) + 5e6, weights, rng.normal(size=(200, 1)).astype(np.float32), 0.1)

    def test_round_trip(self) -> None:
        sites, again = self.sites(), Sites(3, 1, 0.1)
        again.restore({name: a.copy() for name, a in sites.to_arrays().items()})
        assert voxels(again) == voxels(sites)
        np.testing.assert_array_equal(again.positions, sites.positions)
        more = np.full((1, 3), 5e6), np.zeros(1, np.int32), None, np.ones((1, 1), np.float32)
        for s in (sites, again):
            s.add(Observations(*more))
        assert voxels(again) == voxels(sites)

    def test_nothing_round_trips(self) -> None:
        again = Sites(3, 1, 0.1)
        again.restore(Sites(3, 1, 0.1).to_arrays())
        assert len(again) == 0
        assert again.positions.shape == (0, 3)

    @pytest.mark.parametrize(
        "damage",
        ["twice", "negative", "no mass", "mass of one class only", "left its voxel", "below its voxel", "origin"],
    )
    def test_damage_is_refused(self, damage: str) -> None:
        arrays: dict[str, NDArray[Any]] = {name: a.copy() for name, a in self.sites().to_arrays().items()}
        if damage == "twice":
            arrays["voxels"][3] = arrays["voxels"][7]
        elif damage == "negative":
            arrays["voxels"][3] = -1
        elif damage == "mass of one class only":  # less mass than the position was summed over
            arrays["place"][3, :3] = arrays["mass"][3].sum() * PLACE_UNIT
            arrays["mass"][3, 1:] = 0
        elif damage == "left its voxel":
            arrays["place"][3, 1] = int(arrays["mass"][3].sum()) * PLACE_UNIT + 1
        elif damage == "below its voxel":
            arrays["place"][3, 2] = -1
        elif damage == "origin":
            arrays["origin"][1] += 1
        else:
            arrays["mass"][3] = 0
        with pytest.raises(InputError, match="damaged"):
            Sites(3, 1, 0.1).restore(arrays)

    def test_sites_on_the_rim_of_their_voxel_are_whole(self) -> None:
        arrays: dict[str, NDArray[Any]] = {name: a.copy() for name, a in self.sites().to_arrays().items()}
        arrays["place"][3, :3] = (0, 0, int(arrays["mass"][3].sum()) * PLACE_UNIT)
        again = Sites(3, 1, 0.1)
        again.restore(arrays)
        np.testing.assert_array_equal(again.place, arrays["place"])
