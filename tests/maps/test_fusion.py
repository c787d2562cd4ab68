"""Fused maps: the sums of both, voxel by voxel, against dictionaries of whole numbers."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgp.blocks.accumulate import FEATURE_UNIT, MASS_UNIT, PLACE_UNIT, SPREAD_UNIT
from semgp.blocks.cells import CELL
from semgp.blocks.merging import Sums, joined, moved, stored_sums
from semgp.blocks.model import BlockModel
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.evaluation.semantic_kitti import kitti_task
from semgp.gp.model import GPModel
from semgp.gp.stationary import Matern52
from semgp.maps.files import load_map, save_map
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace, occupancy_model
from semgp.maps.fusion import fuse
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.prediction import Prediction
from semgp.readers import SemanticKITTISequence
from semgp.scene.lidar import Lidar
from semgp.scene.town import SyntheticTown
from semgp.voxels import HALF_RANGE, MARGIN

FREE = FreeSpace(occupancy_model(OUTDOOR_LIDAR.resolution, vertical=2), rays=2000)
SMALL = BlockModel(resolution=0.1)
Array = NDArray[np.float64]
Voxels = dict[tuple[int, ...], list[list[int]]]


@pytest.fixture(scope="module")
def scans() -> list[LabelledCloud]:
    town = SyntheticTown(lidar=Lidar(beams=16, columns=300))
    return [town.scan(4 * i).observed for i in range(4)]


def built(
    scans: Iterable[LabelledCloud], model: BlockModel = OUTDOOR_LIDAR, free: FreeSpace | None = None
) -> GPSemanticMap:
    scans = list(scans)
    gp_map = GPSemanticMap(scans[0].classes, model, free=free)
    for scan in scans:
        gp_map.update(scan)
    return gp_map


def transform(degrees: float = 0.0, t: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0, 0, np.radians(degrees)]).as_matrix()
    T[:3, 3] = t
    return T


def in_frame(scan: LabelledCloud, T_a_b: Array) -> LabelledCloud:
    T = np.linalg.inv(T_a_b)
    sensor = None if scan.T_world_sensor is None else T @ scan.T_world_sensor
    return replace(scan, points=scan.points @ T[:3, :3].T + T[:3, 3], T_world_sensor=sensor)


def voxels(arrays: Mapping[str, NDArray[Any]], prefix: str = "") -> Voxels:
    """What each voxel of the world holds, in whole numbers of any size."""
    sums = stored_sums(arrays, prefix)
    spread = sums.spread if len(sums.spread) else np.zeros((len(sums.mass), 4), np.int64)
    rows = zip(sums.voxels.tolist(), sums.mass.tolist(), sums.place.tolist(), spread.tolist())
    return {tuple(v): [mass, place, variances] for v, mass, place, variances in rows}


def held(gp_map: GPSemanticMap) -> dict[str, Voxels]:
    arrays = gp_map.to_arrays()[1]
    return {prefix: voxels(arrays, prefix) for prefix in ("", "free.") if prefix + "voxels" in arrays}


def added(parts: Iterable[Voxels]) -> Voxels:
    total: Voxels = {}
    for part in parts:
        for key, (mass, place, spread) in part.items():
            if key in total:
                m, p, s = total[key]
                draws = s[3] | spread[3]
                mass, place = [x + y for x, y in zip(m, mass)], [x + y for x, y in zip(p, place)]
                spread = [*(x + y for x, y in zip(s[:3], spread[:3])), draws]
            total[key] = [mass, place, spread]
    return total


def assert_same_answers(a: GPSemanticMap, b: GPSemanticMap, points: Array) -> None:
    x, y = a.query(points), b.query(points)
    np.testing.assert_allclose(x.probability, y.probability, atol=1e-6)
    np.testing.assert_allclose(cast("Array", x.variance), cast("Array", y.variance), atol=1e-6)
    np.testing.assert_array_equal(x.observed, y.observed)
    assert (x.occupancy is None) == (y.occupancy is None)
    if x.occupancy is not None and y.occupancy is not None:
        np.testing.assert_allclose(x.occupancy.probability, y.occupancy.probability, atol=1e-6)
        np.testing.assert_array_equal(x.occupancy.known, y.occupancy.known)


class TestTheMapOfAllScans:
    @pytest.mark.parametrize("free", [None, FREE])
    @pytest.mark.parametrize("split", [slice(None, None, 2), slice(2)])
    def test_to_the_last_bit(self, scans: list[LabelledCloud], split: slice, free: FreeSpace | None) -> None:
        first = scans[split]
        a, b = built(first, free=free), built([s for s in scans if s not in first], free=free)
        b.query(scans[0].points[:100])  # asked in between
        everything, fused = built(scans, free=free), fuse(a, b)
        assert held(fused) == held(everything)
        assert len(held(fused)) == (1 if free is None else 2)
        assert_same_answers(fused, everything, scans[1].points[::5])
        assert held(fuse(b, a)) == held(everything)

    def test_neither_map_is_changed(self, scans: list[LabelledCloud]) -> None:
        a, b = built(scans[:2], free=FREE), built(scans[2:], free=FREE)
        before = held(a), held(b)
        fused = fuse(a, b, transform(20))
        fused.update(scans[0])
        assert (held(a), held(b)) == before
        a.update(scans[2])
        assert len(a) < len(fused)

    def test_it_lives_on(self, scans: list[LabelledCloud], tmp_path: Path) -> None:
        fused = fuse(built(scans[:1], free=FREE), built(scans[1:2], free=FREE))
        save_map(fused, tmp_path / "fused.semgp")
        again = cast("GPSemanticMap", load_map(tmp_path / "fused.semgp"))
        for gp_map in (fused, again):
            for scan in scans[2:]:
                gp_map.update(scan)
            assert held(gp_map) == held(built(scans, free=FREE))

    @pytest.mark.parametrize("uncertain", [(0,), (2,), (1, 2)])
    def test_uncertain_positions_on_one_side_or_both(
        self, scans: list[LabelledCloud], uncertain: tuple[int, ...]
    ) -> None:
        error = np.diag([0.01, 0.04, 0.02, 1e-6, 1e-6, 1e-5])
        seen = [replace(s, pose_covariance=error) if i in uncertain else s for i, s in enumerate(scans)]
        fused, everything = fuse(built(seen[:2]), built(seen[2:])), built(seen)
        assert held(fused) == held(everything)
        assert_same_answers(fused, everything, scans[1].points[::20])

    def test_features_and_mass_of_no_class(self, corner: LabelledCloud) -> None:
        rng = np.random.default_rng(0)
        weights = (rng.random((360, 3)) / 3).astype(np.float32)
        colours = rng.integers(0, 255, (360, 3)).astype(np.uint8)
        cloud = replace(corner, labels=None, weights=weights, colours=colours)
        model = BlockModel(Matern52((1.0, 1.0, 1.0, 0.2), 0.5), resolution=0.1, features=("red",), other=True)
        parts = [cloud[::2], cloud[1::2]]
        fused, everything = fuse(built(parts[:1], model), built(parts[1:], model)), built(parts, model)
        assert held(fused) == held(everything)
        assert_same_answers(fused, everything, corner.points)

    @pytest.mark.parametrize("free", [None, FREE])
    def test_with_an_empty_map(self, scans: list[LabelledCloud], free: FreeSpace | None) -> None:
        some, empty = built(scans[:1], free=free), GPSemanticMap(scans[0].classes, OUTDOOR_LIDAR, free=free)
        for fused in (fuse(some, empty), fuse(empty, some)):
            assert held(fused) == held(some)
            for name, array in some.to_arrays()[1].items():
                np.testing.assert_array_equal(fused.to_arrays()[1][name], array)
            assert_same_answers(fused, some, scans[0].points[::20])
        nothing = fuse(empty, empty)
        with pytest.raises(InputError, match="no labelled points"):
            nothing.query(scans[0].points)
        nothing.update(scans[0])
        assert held(nothing) == held(some)

    def test_free_space_where_both_keep_it(self, scans: list[LabelledCloud]) -> None:
        fused = fuse(built(scans[:2], free=FREE), built(scans[2:]))
        assert fused.free is None
        assert held(fused) == held(built(scans))

    def test_of_semantic_kitti(self, data_dir: Path) -> None:
        folder = data_dir / "semantickitti_08"
        if not folder.is_dir():
            pytest.skip(f"{folder} is not there")
        task = kitti_task(SemanticKITTISequence(folder, world="camera"), keep=0.05, scans=2)
        a, b = (built([scan], free=FREE) for scan in task.training)
        fused, everything = fuse(a, b), built(task.training, free=FREE)
        assert held(fused) == held(everything)
        assert_same_answers(fused, everything, task.truth.points[::100])


class TestTransforms:
    @pytest.mark.parametrize("steps", [(0, 0, 0), (3, -1, 70), (CELL, 0, -CELL), (25_000_000, 2_500_001, 0)])
    def test_whole_voxels_are_exact(self, scans: list[LabelledCloud], steps: tuple[int, int, int]) -> None:
        b = built(scans[2:], free=FREE)
        a = built([replace(s, T_world_sensor=None) for s in scans[:2]]) if max(steps) < 1e6 else None
        T = transform(t=cast("tuple[float, float, float]", tuple(0.2 * np.array(steps))))
        fused = fuse(a or GPSemanticMap(b.classes, b.model, free=FREE), b, T)
        for prefix, found in held(fused).items():
            there = {tuple(np.add(v, steps).tolist()): sums for v, sums in held(b)[prefix].items()}
            assert found == added([held(a)[prefix] if a else {}, there])

    def test_each_site_goes_to_where_its_mean_lies(self, scans: list[LabelledCloud]) -> None:
        error = np.diag([0.01, 0.04, 0.02, 0, 0, 0])
        b = built([replace(s, pose_covariance=error) for s in scans[2:]])
        T = transform(30, (1.234, -5.0, 0.57))
        fused = fuse(GPSemanticMap(b.classes, b.model), b, T)
        found = held(fused)[""]
        want: dict[tuple[int, ...], list[Any]] = {}
        turned = np.diag(T[:3, :3] @ error[:3, :3] @ T[:3, :3].T)
        for mean, (mass, _, spread) in zip(b.positions, held(b)[""].values()):
            there = T[:3, :3] @ mean + T[:3, 3]
            members = want.setdefault(tuple(np.floor(there / 0.2).astype(int).tolist()), [])
            members.append((mass, there, spread[3]))
        assert found.keys() == want.keys()
        assert len(found) < len(b)
        for position, (voxel, (mass, _, spread)) in zip(fused.positions, found.items()):
            members = want[voxel]
            total = sum(sum(m) for m, _, _ in members)
            assert mass == np.sum([m for m, _, _ in members], axis=0).tolist()
            np.testing.assert_allclose(position, sum(sum(m) * x for m, x, _ in members) / total, rtol=0, atol=1e-7)
            np.testing.assert_allclose(np.array(spread[:3]) / total / SPREAD_UNIT, turned, atol=1e-6)
            assert spread[3] == np.bitwise_or.reduce([draws for _, _, draws in members])

    def test_robots_in_frames_of_their_own(self, scans: list[LabelledCloud]) -> None:
        T, points = transform(30, (4.3, -2.1, 0.4)), scans[1].points[::5]
        everything, a = built(scans, free=FREE), built(scans[:2], free=FREE)
        b = built([in_frame(s, T) for s in scans[2:]], free=FREE)
        change = difference(fuse(a, b, T).query(points), everything.query(points))
        assert change < 0.02
        assert change < 0.3 * difference(a.query(points), everything.query(points))
        assert change < 0.1 * difference(fuse(a, b).query(points), everything.query(points))
        in_b = in_frame(scans[1], T).points[::5]
        back = fuse(b, a, np.linalg.inv(T)).query(in_b)
        assert difference(back, built([in_frame(s, T) for s in scans]).query(in_b)) < 0.02


def difference(a: Prediction, b: Prediction) -> float:
    return float(np.abs(a.probability - b.probability).sum(axis=1).mean())


class TestOtherModels:
    def test_the_same_voxels(self, scans: list[LabelledCloud]) -> None:
        other = replace(OUTDOOR_LIDAR, s_n=0.5, prior=tuple(range(1, len(scans[0].classes) + 1)))
        a, b = built(scans[:2], OUTDOOR_LIDAR), built(scans[2:], replace(OUTDOOR_LIDAR, nugget=0.2))
        fused, everything = fuse(a, b, model=other), built(scans, other)
        assert fused.model == other
        assert held(fused) == held(everything)
        assert_same_answers(fused, everything, scans[1].points[::20])

    def test_larger_voxels(self, scans: list[LabelledCloud]) -> None:
        coarse = replace(OUTDOOR_LIDAR, resolution=0.5)
        free = FreeSpace(occupancy_model(0.5), rays=2000)
        a, b = built(scans[:2], OUTDOOR_LIDAR, FREE), built(scans[2:], coarse, free)
        fused = fuse(a, b, model=coarse, free=free)
        assert fused.free == free
        masses: dict[tuple[int, ...], list[int]] = {}
        for gp_map in (a, b):
            for position, (mass, _, _) in zip(gp_map.positions, held(gp_map)[""].values()):
                key = tuple(np.floor(position / 0.5).astype(int).tolist())
                masses[key] = np.add(masses.get(key, 0), mass).tolist()
        assert {v: mass for v, (mass, _, _) in held(fused)[""].items()} == masses
        everything, points = built(scans, coarse, free), scans[1].points[::5]
        assert difference(fused.query(points), everything.query(points)) < 0.02

    def test_free_space_of_both_must_be_one_or_given(self, scans: list[LabelledCloud]) -> None:
        a, b = built(scans[:2], free=FREE), built(scans[2:], free=replace(FREE, seed=1))
        with pytest.raises(InputError, match=r"free space differ in seed \(0 and 1\)"):
            fuse(a, b)
        assert fuse(a, b, free=FREE).free == FREE
        other = replace(FREE, model=replace(cast("BlockModel", FREE.model), s_n=1.0))
        with pytest.raises(InputError, match=r"model\.s_n \(0\.13 and 1\.0\)"):
            fuse(a, built(scans[2:], free=other))
        with pytest.raises(InputError, match="voxels of another size"):
            fuse(a, b, model=replace(OUTDOOR_LIDAR, resolution=0.4))
        with pytest.raises(InputError, match="not both maps keep free space"):
            fuse(a, built(scans[2:]), free=FREE)


def random_sums(rng: np.random.Generator, n: int, uncertain: bool) -> Sums:
    voxels = rng.integers(-3, 3, (n, 3)) + rng.integers(-90, 90, 3)
    mass = rng.integers(1, rng.choice([5, 2**31]), (n, 2)).astype(np.uint32)
    total = mass.sum(axis=1, dtype=np.int64)[:, None]
    place = (total * rng.integers(0, PLACE_UNIT, (n, 4))).astype(np.int64)
    spread = np.hstack([rng.integers(0, 2**50, (n, 3)), rng.integers(0, 2**48, (n, 1))])
    return Sums(voxels, mass, place, spread[: n if uncertain else 0], np.zeros(3, np.int64))


@given(st.integers(0, 2**32 - 1), st.lists(st.booleans(), min_size=1, max_size=4))
@settings(deadline=None, max_examples=50)
def test_joined_sums_of_voxels_that_come_up_often(seed: int, uncertain: list[bool]) -> None:
    rng = np.random.default_rng(seed)
    parts = [random_sums(rng, int(rng.integers(0, 60)), u) for u in uncertain]
    want: Voxels = {}
    for part in parts:
        spread = part.spread if len(part.spread) else np.zeros((len(part.mass), 4), np.int64)
        for v, *sums in zip(part.voxels.tolist(), part.mass.tolist(), part.place.tolist(), spread.tolist()):
            both = added([{tuple(v): sums}, {k: s for k, s in want.items() if k == tuple(v)}])[tuple(v)]
            if sum(both[0]) >= 2**32:  # more than fits: the heavier stays
                both = max(want[tuple(v)], sums, key=lambda s: sum(s[0]))
            want[tuple(v)] = both
    arrays = joined(parts, np.array([CELL, 0, -CELL]))
    assert voxels(arrays) == want
    assert ("spread" in arrays) == any(u and len(p.mass) > 0 for u, p in zip(uncertain, parts))


def at_most(mass: int, voxel: tuple[int, int, int] = (0, 0, 0)) -> Sums:
    """A site with as large a feature as may be."""
    place = np.array([[mass * PLACE_UNIT] * 3 + [mass * 30_000 * FEATURE_UNIT]])
    spread, origin = np.zeros((0, 4), np.int64), np.zeros(3, np.int64)
    return Sums(np.array([voxel]), np.array([[mass]], np.uint32), place, spread, origin)


def test_full_sites_never_wrap_round() -> None:
    full, more, origin = at_most(2**32 - 1), at_most(MASS_UNIT), np.zeros(3, np.int64)
    for parts in ([full, more], [more, full], [full, full]):
        (found,) = voxels(joined(parts, origin)).values()
        assert found[0] == [2**32 - 1]
        assert found[1][3] == (2**32 - 1) * 30_000 * FEATURE_UNIT
    (found,) = voxels(joined([more, more], origin)).values()
    assert found[0] == [2 * MASS_UNIT]


class TestBadInput:
    @pytest.mark.parametrize("other", [None, "map.semgp", np.zeros((3, 3)), OUTDOOR_LIDAR])
    def test_no_map(self, corner: LabelledCloud, other: Any) -> None:
        gp_map = built([corner], SMALL)
        for a, b in ((gp_map, other), (other, gp_map)):
            with pytest.raises(InputError, match="only maps of a BlockModel"):
                fuse(a, b)

    def test_the_paper_s_map(self, corner: LabelledCloud) -> None:
        whole = GPSemanticMap(corner.classes, GPModel(n_inducing=20))
        with pytest.raises(InputError, match=r"b is of a GPModel.*Committee"):
            fuse(built([corner], SMALL), whole)

    def test_maps_that_forget(self, scans: list[LabelledCloud]) -> None:
        forgets = GPSemanticMap(scans[0].classes, OUTDOOR_LIDAR, free=FREE, forgetting=Forgetting(5))
        with pytest.raises(InputError, match="b forgets"):
            fuse(built(scans[:1], free=FREE), forgets)

    def test_other_classes(self, corner: LabelledCloud) -> None:
        other = GPSemanticMap(Classes(("floor", "wall", "lamp")), SMALL)
        with pytest.raises(InputError, match=r"a has floor, wall, table, b has floor, wall, lamp"):
            fuse(built([corner], SMALL), other)

    def test_models_that_differ_are_named(self, corner: LabelledCloud) -> None:
        other = built([corner], replace(SMALL, resolution=0.2, leaf=32))
        with pytest.raises(InputError, match=r"resolution \(0\.1 and 0\.2\), leaf \(64 and 32\).*model="):
            fuse(built([corner], SMALL), other)

    @pytest.mark.parametrize(
        ("model", "message"),
        [
            (GPModel(), "must be a BlockModel"),
            (replace(SMALL, other=True), "other must be those of the maps"),
            (BlockModel(features=("red",)), "features must be those"),
            (replace(SMALL, prior=(1.0, 1.0)), "2 classes, the map has 3"),
        ],
    )
    def test_models_that_do_not_fit(self, corner: LabelledCloud, model: Any, message: str) -> None:
        a = built([corner], SMALL)
        with pytest.raises(InputError, match=message):
            fuse(a, a, model=model)

    def test_experts_take_positions_as_certain(self, corner: LabelledCloud) -> None:
        uncertain = built([replace(corner, pose_covariance=np.eye(6) * 1e-4)], SMALL)
        with pytest.raises(InputError, match="dirichlet experts take positions as certain"):
            fuse(uncertain, uncertain, model=replace(SMALL, posterior="dirichlet", weights=None))

    @pytest.mark.parametrize(
        ("T", "message"),
        [
            (np.full((4, 4), np.nan), "NaN"),
            (np.eye(3), r"shape \(4, 4\)"),
            (2 * np.eye(4), "no rigid transform"),
            (np.diag([1.0, 1, -1, 1]), "no rigid transform"),
            ("turned", "array of numbers"),
            (transform(t=(1e300, 0, 0)), "too far for voxels"),
            (transform(5, t=(1e6, 0, 0)), "lie too far apart"),
            (transform(t=(1e6, 0, 0)), "lie too far apart"),
        ],
    )
    def test_transforms(self, corner: LabelledCloud, T: Any, message: str) -> None:
        a = built([corner], SMALL)
        with pytest.raises(InputError, match=message):
            fuse(a, a, T)

    def test_the_range_of_the_keys(self, corner: LabelledCloud) -> None:
        origin, rim = np.zeros(3, np.int64), HALF_RANGE - MARGIN
        assert len(joined([at_most(1, (0, -rim, 0)), at_most(1, (0, 0, rim - 1))], origin)["voxels"]) == 2
        for voxel in ((0, -rim - 1, 0), (0, 0, rim)):
            with pytest.raises(InputError, match="too far apart"):
                joined([at_most(1, voxel)], origin)
        a = built([corner], SMALL)
        T = transform(t=(9e4, -9e4, 0))
        assert len(fuse(a, a, T)) == 2 * len(a)

    def test_moved_sites_are_none_the_less_whole(self) -> None:
        empty = random_sums(np.random.default_rng(0), 0, uncertain=True)
        for T in (np.eye(4), transform(20)):
            assert moved(empty, T, 0.1, 0.2).voxels.shape == (0, 3)


@pytest.mark.parametrize("make", [transform, lambda: transform(0, (0.1, 0.2, 0.3)), lambda: transform(90)])
def test_mass_is_never_lost(corner: LabelledCloud, make: Callable[[], Array]) -> None:
    a = built([corner], SMALL)
    mass = np.sum([m for m, _, _ in held(a)[""].values()], axis=0)
    fused = held(fuse(a, a, make()))[""]
    np.testing.assert_array_equal(np.sum([m for m, _, _ in fused.values()], axis=0), 2 * mass)
