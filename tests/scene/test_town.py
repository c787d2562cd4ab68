"""The synthetic town: its scans against its geometry, its route, its label faults against what they promise."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.checks import rigid_transform
from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.scene.lidar import Lidar, PatchFaults
from semgp.scene.raycast import BOX, Solids, cast
from semgp.scene.streets import BLOCK, MISTAKEN_FOR, ROAD, TOWN_CLASSES, town_block
from semgp.scene.town import SyntheticTown
from tests.scene.solids import level

Array = NDArray[np.float64]
Labels = NDArray[np.int32]

EXACT = Lidar(beams=24, columns=300, noise=0)
LAP = 1420  # metres, a little more than one lap of the route


def labels_of(town: SyntheticTown, i: int) -> tuple[Labels, Labels]:
    """Return true and observed labels of a scan."""
    scan = town.scan(i)
    assert scan.truth.labels is not None
    assert scan.observed.labels is not None
    return scan.truth.labels, scan.observed.labels


def cells_seen(town: SyntheticTown, scans: Iterable[int]) -> set[bytes]:
    """Return which square metres of the ground plan have points."""
    plan = [np.unique(np.floor(town.scan(i).truth.points[:, :2]).astype(np.int64), axis=0) for i in scans]
    return {cell.tobytes() for cells in plan for cell in cells}


def test_scans_are_the_same_in_any_order_and_differ_by_seed_and_number() -> None:
    town, again = SyntheticTown(3, EXACT), SyntheticTown(3, EXACT)
    first = town.scan(7)
    again.scan(3)
    same = again.scan(7)
    np.testing.assert_array_equal(first.truth.points, same.truth.points)
    np.testing.assert_array_equal(first.truth.labels, same.truth.labels)
    np.testing.assert_array_equal(first.observed.labels, same.observed.labels)
    for other in (town.scan(8), SyntheticTown(4, EXACT).scan(7)):
        assert not np.array_equal(other.truth.points, first.truth.points)


@pytest.mark.parametrize("i", [0, 137, 634, 2_345_678])
def test_points_lie_on_things_of_their_class_and_in_nothing(i: int) -> None:
    town = SyntheticTown(1, EXACT)
    truth = town.scan(i).truth
    off_own_class = np.full(len(truth), np.inf)
    for thing in town.things(i):
        for solid in thing.solids:
            depth = level(solid, truth.points)
            assert (depth > 1 - 1e-6).all()
            own = truth.labels == TOWN_CLASSES.index(thing.name)
            off_own_class[own] = np.minimum(off_own_class, np.abs(depth - 1))[own]
    assert off_own_class.max() < 1e-6
    distance = np.linalg.norm(truth.points - town.pose(i)[:3, 3], axis=1)
    assert distance.max() <= EXACT.reach
    assert len(truth) > 0.85 * 24 * 300


def test_wedges_of_rays_meet_what_rays_cast_against_everything_meet() -> None:
    rng = np.random.default_rng(0)
    n = 300
    centre = rng.uniform(-30, 30, (n, 3)) * (1, 1, 0.1)
    centre = np.vstack([centre[np.hypot(*centre[:, :2].T) > 4], [0, 0, -3]])  # the last one is the ground below
    n = len(centre)
    half = np.vstack([rng.uniform(0.1, 1.5, (n - 1, 3)), [60, 60, 1]])
    solids = Solids(np.append(rng.integers(0, 3, n - 1), BOX), centre, half, rng.uniform(0, 6, n))
    T = np.eye(4)
    T[:2, :2] = (np.cos(2), -np.sin(2)), (np.sin(2), np.cos(2))
    for lidar in (EXACT, Lidar(beams=5, columns=7, top=40, bottom=-60, reach=25, noise=0)):
        points, solid = lidar.measure(solids, T, rng)
        rays = lidar.rays.reshape(-1, 3) @ T[:3, :3].T
        hits = cast(solids, (0, 0, 0), rays)
        met = hits.distance <= lidar.reach
        np.testing.assert_array_equal(solid, hits.solid[met])
        np.testing.assert_allclose(points, (hits.distance[:, None] * rays)[met])
        assert len(np.unique(solid)) > 3


def test_rays_fan_out_from_straight_ahead_to_the_left_and_from_top_to_bottom() -> None:
    rays = Lidar(beams=3, columns=4, top=10, bottom=-30).rays
    np.testing.assert_allclose(rays[:, 1], Lidar(beams=1, columns=4, top=-10, bottom=-10).rays[:, 0], atol=1e-15)
    ahead, left = rays[0], rays[1]
    np.testing.assert_allclose(np.degrees(np.arctan2(ahead[:, 2], ahead[:, 0])), [10, -10, -30])
    np.testing.assert_allclose(left, ahead[:, [1, 0, 2]], atol=1e-15)


def test_noise_moves_points_along_their_rays() -> None:
    town = SyntheticTown(lidar=EXACT)
    exact = town.scan(20).truth
    noisy = SyntheticTown(lidar=Lidar(beams=24, columns=300, noise=0.05)).scan(20).truth
    np.testing.assert_array_equal(exact.labels, noisy.labels)
    rays = exact.points - town.pose(20)[:3, 3]
    distance = np.linalg.norm(rays, axis=1)
    moved = ((noisy.points - exact.points) * rays).sum(axis=1) / distance
    np.testing.assert_allclose(noisy.points - exact.points, (moved / distance)[:, None] * rays, atol=1e-9)
    assert moved.std() == pytest.approx(0.05, rel=0.05)
    assert moved.mean() == pytest.approx(0, abs=0.003)


def test_a_drive_sees_all_classes() -> None:
    town = SyntheticTown(lidar=Lidar(columns=300))
    assert 10 <= len(town.classes) <= 12
    count = sum(np.bincount(labels_of(town, i)[0], minlength=len(town.classes)) for i in range(0, 600, 60))
    share = count / np.sum(count)
    assert share.min() > 2e-4
    assert share.max() < 0.6


def test_area_seen_grows_with_the_distance_and_neighbouring_scans_overlap() -> None:
    town = SyntheticTown(lidar=Lidar(beams=32, columns=300))
    seen: set[bytes] = set()
    gained = []
    for start in range(0, 2 * LAP, LAP // 2):
        here = cells_seen(town, range(start, start + LAP // 2, 90))
        gained.append(len(here - seen))
        seen |= here
    np.testing.assert_allclose(gained, np.mean(gained), rtol=0.25)
    one, next_one = cells_seen(town, [200]), cells_seen(town, [201])
    assert len(one & next_one) > 0.4 * len(one)


def test_the_car_goes_ahead_on_the_road_ten_metres_a_second_past_all_things() -> None:
    town = SyntheticTown(5)
    poses = np.array([rigid_transform("pose", town.pose(i)) for i in range(0, 2 * LAP)])
    step = np.diff(poses[:, :3, 3], axis=0)
    length = np.linalg.norm(step, axis=1)
    assert length.mean() == pytest.approx(1, abs=0.02)
    assert 0.65 < length.min() <= length.max() < 1.35  # the lane is shorter inside a curve than in the middle
    assert ((step * poses[:-1, :3, 0]).sum(axis=1) > 0.98 * length).all()  # x points ahead
    off_street = (poses[:, :2, 3] + BLOCK / 2) % BLOCK - BLOCK / 2
    assert np.abs(off_street).min(axis=1).max() < ROAD
    to_the_right = -(off_street * poses[:, :2, 1]).sum(axis=1)
    straight = np.abs(poses[:, :2, 0]).max(axis=1) > 1 - 1e-9
    np.testing.assert_allclose(to_the_right[straight], ROAD / 2)
    np.testing.assert_array_equal(poses[:, 2, 2], 1)


@pytest.mark.parametrize(("column", "row"), [(0, 0), (-1, 5), (10**6, -(10**7))])
def test_nothing_stands_on_the_carriageways_between_four_blocks(column: int, row: int) -> None:
    along, across = np.arange(-BLOCK + ROAD, BLOCK - ROAD, 0.4), np.linspace(-ROAD + 0.05, ROAD - 0.05, 9)
    x, y, z = (a.ravel() for a in np.meshgrid(along, across, (0.02, 0.7, 1.73)))
    crossing = np.array([column, row, 0]) * BLOCK
    points = crossing + np.vstack([np.column_stack([x, y, z]), np.column_stack([y, x, z])])
    for thing in (t for c in (column - 1, column) for r in (row - 1, row) for t in town_block(2, c, r)):
        assert all((level(solid, points) > 1).all() for solid in thing.solids)


def test_blocks_differ_by_seed_and_place_and_keep_to_their_place() -> None:
    def plan(seed: int, column: int, row: int) -> list[Array]:
        corner = np.array([column, row, 0]) * BLOCK
        return [solid.centre - corner for thing in town_block(seed, column, row) for solid in thing.solids]

    plans = [plan(*key) for key in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))]
    for i, one in enumerate(plans):
        assert all(0 < place < BLOCK for centre in one for place in centre[:2])
        assert not any(np.array_equal(one, other) for other in plans[:i])


def test_faults_have_the_promised_shares_and_likely_wrong_classes() -> None:
    points = np.random.default_rng(0).uniform(-50, 50, (200_000, 3)) * (1, 1, 0.01)
    truth = np.random.default_rng(1).integers(0, len(TOWN_CLASSES), len(points), dtype=np.int32)
    given = PatchFaults(wrong=0.2, missing=0.3).apply(points, truth, MISTAKEN_FOR, seed=4, scan=9)
    missing, wrong = given == MISSING, (given != truth) & (given != MISSING)
    assert missing.mean() == pytest.approx(0.3, abs=0.01)
    assert wrong[~missing].mean() == pytest.approx(0.2, abs=0.01)
    assert (np.arange(len(TOWN_CLASSES))[:, None] != MISTAKEN_FOR).all()
    for c in range(len(TOWN_CLASSES)):
        kinds, count = np.unique(given[wrong & (truth == c)], return_counts=True)
        assert set(kinds) == set(MISTAKEN_FOR[c])
        assert count.min() > 0.8 * count.max()
    for share in (0.0, 1.0):
        given = PatchFaults(wrong=share).apply(points, truth, MISTAKEN_FOR, seed=4, scan=9)
        assert (given != truth).mean() == share


def faulty_cells(scan: int) -> tuple[Labels, NDArray[np.bool_]]:
    """Return the given labels (cell, point) of twenty points in each of 3,000 cells, and which cells are wrong."""
    rng = np.random.default_rng(2)
    corners = np.stack(np.meshgrid(np.arange(-30, 30), np.arange(50), [-1]), axis=-1).reshape(-1, 1, 3)
    points = 0.4 * (corners + rng.uniform(0.01, 0.99, (len(corners), 20, 3)))
    truth = np.zeros(points[..., 0].size, dtype=np.int32)
    given = PatchFaults(wrong=0.3, cell=0.4).apply(points.reshape(-1, 3), truth, MISTAKEN_FOR, seed=0, scan=scan)
    labels = given.reshape(-1, 20)
    return labels, (labels != 0).mean(axis=1) > 0.5


def test_most_wrong_labels_fill_cells_with_one_wrong_class_and_the_rest_come_singly() -> None:
    labels, wrong = faulty_cells(0)
    assert wrong.mean() == pytest.approx(0.24 / 0.94, abs=0.03)
    assert (labels[~wrong] != 0).mean() == pytest.approx(0.06, abs=0.01)
    assert (labels[wrong] != 0).all()
    commonest = [np.bincount(cell).max() for cell in labels[wrong]]
    assert np.mean(commonest) == pytest.approx(20 * (0.94 + 0.06 / 3), abs=0.2)


def test_cells_keep_their_faults_for_a_while_and_no_longer() -> None:
    cells = [faulty_cells(scan)[1] for scan in range(12)]
    share = cells[0].mean()
    for later, kept in ((1, 0.9), (5, 0.5), (10, 0.0), (11, 0.0)):
        expected = kept + (1 - kept) * share
        assert cells[later][cells[0]].mean() == pytest.approx(expected, abs=0.06)


def test_both_clouds_have_the_same_points_and_the_faults_that_were_asked_for() -> None:
    town = SyntheticTown(lidar=EXACT, faults=PatchFaults(wrong=0.1, missing=0.2))
    scan = town.scan(11)
    np.testing.assert_array_equal(scan.truth.points, scan.observed.points)
    np.testing.assert_array_equal(scan.truth.T_world_sensor, town.pose(11))
    truth, observed = labels_of(town, 11)
    assert (observed == MISSING).mean() == pytest.approx(0.2, abs=0.05)
    assert 0.04 < (observed != truth)[observed != MISSING].mean() < 0.16
    perfect = SyntheticTown(lidar=EXACT, faults=PatchFaults(wrong=0)).scan(11)
    np.testing.assert_array_equal(perfect.observed.labels, truth)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: SyntheticTown(-1), "seed"),
        (lambda: SyntheticTown(0.5), "seed"),  # type: ignore[arg-type]
        (lambda: SyntheticTown().scan(-1), "number"),
        (lambda: SyntheticTown().scan(1.5), "number"),  # type: ignore[arg-type]
        (lambda: SyntheticTown().scan(10**7), "number"),
        (lambda: SyntheticTown().pose(np.nan), "number"),  # type: ignore[arg-type]
        (lambda: Lidar(beams=0), "beam"),
        (lambda: Lidar(columns=-3), "column"),
        (lambda: Lidar(top=-30), "bottom and top"),
        (lambda: Lidar(bottom=-90), "bottom and top"),
        (lambda: Lidar(bottom=np.nan), "bottom and top"),
        (lambda: Lidar(reach=0), "reach"),
        (lambda: Lidar(reach=1e6), "reach"),
        (lambda: Lidar(noise=-0.1), "noise"),
        (lambda: PatchFaults(wrong=1.1), "shares"),
        (lambda: PatchFaults(missing=np.nan), "shares"),
        (lambda: PatchFaults(cell=0), "cell"),
    ],
)
def test_settings_out_of_range_are_refused(make: Callable[[], object], match: str) -> None:
    with pytest.raises(InputError, match=match):
        make()
