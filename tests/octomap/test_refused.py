"""Arrays that are stored, and bad input."""

from dataclasses import replace

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.octomap import SemanticOctoMap, SensorModel
from tests.octomap.clouds import CLASSES, assert_same, built, random_cloud, seen_from


class TestStorage:
    def test_arrays_keep_everything(self) -> None:
        octomap = built(
            random_cloud(13), random_cloud(14), max_range=1.5, sensor=SensorModel(hit=0.8), origin=(1, 2, 3)
        )
        header, arrays = octomap.to_arrays()
        again = SemanticOctoMap.from_arrays(CLASSES, header, arrays)
        assert again.info()["sensor"] == octomap.info()["sensor"]
        for cloud in (None, random_cloud(15)):
            if cloud is not None:
                octomap.update(cloud)
                again.update(cloud)
            assert_same(octomap, again)

    @pytest.mark.parametrize(
        ("name", "damage"),
        [
            ("bricks", lambda a: a[::-1]),
            ("bricks", lambda a: a - a[0] - 1),
            ("bricks", lambda a: a.astype(np.int32)),
            ("known", lambda a: a[1:]),
            ("known", lambda a: a * 0),
            ("log_odds", lambda a: a * np.nan),
            ("mixed_bricks", lambda a: a + 10**6),
            ("mixed_log_odds", lambda a: a[:, :3]),
            ("voxels", lambda a: a | 1 << 48),
            ("voxel_classes", lambda a: a - 1),
            ("class", lambda a: a + 3),
            ("mass", lambda a: -a),
            ("colour_sums", lambda a: a[:5]),
        ],
    )
    def test_damaged_arrays_are_refused(self, name: str, damage: object) -> None:
        header, arrays = built(random_cloud(16)).to_arrays()
        arrays[name] = damage(arrays[name])  # type: ignore[operator]
        with pytest.raises(InputError, match="stored"):
            SemanticOctoMap.from_arrays(CLASSES, header, arrays)

    @pytest.mark.parametrize("name", ["resolution", "sensor", "rays"])
    def test_a_header_that_lacks_something_is_refused(self, name: str) -> None:
        header, arrays = built(random_cloud(17)).to_arrays()
        del header[name]
        with pytest.raises(InputError, match=name):
            SemanticOctoMap.from_arrays(CLASSES, header, arrays)


class TestBadInput:
    @pytest.mark.parametrize("resolution", [0, -0.1, np.nan, np.inf, "fine"])
    def test_resolution(self, resolution: float) -> None:
        with pytest.raises(InputError, match="resolution"):
            SemanticOctoMap(CLASSES, resolution)

    def test_other_settings(self) -> None:
        with pytest.raises(InputError, match="max_range"):
            SemanticOctoMap(CLASSES, max_range=0)
        with pytest.raises(InputError, match="origin"):
            SemanticOctoMap(CLASSES, origin=(0, np.nan, 0))
        with pytest.raises(InputError, match="upper"):
            built(random_cloud(0)).unknown((0, 0, 0), (1, 1))
        with pytest.raises(InputError, match="clamp_min"):
            SensorModel(hit=0.3)
        with pytest.raises(InputError, match="threshold"):
            SensorModel(threshold=1)

    def test_rays_need_a_pose(self) -> None:
        with pytest.raises(InputError, match="rays=False"):
            built(replace(random_cloud(0), T_world_sensor=None))

    def test_other_classes(self) -> None:
        with pytest.raises(InputError, match="classes"):
            SemanticOctoMap(Classes(("road",))).update(random_cloud(0))

    def test_an_empty_cloud_changes_nothing(self) -> None:
        cloud = random_cloud(18)
        octomap, twin = built(cloud), built(cloud)
        octomap.update(cloud[:0])
        assert_same(octomap, twin)

    @pytest.mark.parametrize("rays", [True, False])
    def test_points_beyond_reach_are_refused_and_the_map_stays(self, rays: bool) -> None:
        cloud = random_cloud(19)
        octomap, twin = built(cloud, rays=rays), built(cloud, rays=rays)
        far = replace(cloud, points=np.vstack([cloud.points[1:], [[5e6, 0, 0]]]))
        with pytest.raises(InputError, match=r"point .* beyond the map, which reaches 3276\.8 m"):
            octomap.update(far)
        assert_same(octomap, twin)

    def test_a_sensor_beyond_reach_is_refused(self) -> None:
        with pytest.raises(InputError, match=r"sensor .* origin"):
            built(seen_from((0, -1e5, 0), [[0, 0, 0]]))

    def test_queries_beyond_reach_are_unknown(self) -> None:
        octomap = built(random_cloud(20))
        assert not octomap.query([[5e6, 5e6, 0], [0, 0, -1e300]]).observed.any()
        for depth in (0, 5, None):
            assert not octomap.query_occupancy([[5e6, 5e6, 0]], depth).known.any()

    @pytest.mark.parametrize("depth", [-1, 17, 2.5])
    def test_depth(self, depth: int) -> None:
        with pytest.raises(InputError, match="depth"):
            built(random_cloud(0)).query_occupancy([[0, 0, 0]], depth)

    def test_a_map_without_labels_says_so(self) -> None:
        with pytest.raises(InputError, match="no labels"):
            built().query([[0, 0, 0]])
