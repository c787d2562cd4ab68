"""What covers a surface."""

import numpy as np
import pytest

from semgp.errors import InputError
from semgp.picture.coverage import picture_resolution, spacing_of, surface_points


class TestCoverage:
    plane = np.array([(x, y, 1.0) for x in np.arange(0, 2, 0.1) for y in np.arange(0, 2, 0.1)])

    @pytest.mark.parametrize("resolution", [0.02, 0.03, 0.07])
    def test_finer_than_the_data_the_plane_is_filled(self, resolution: float) -> None:
        rng = np.random.default_rng(0)
        points = surface_points(self.plane + rng.normal(scale=0.001, size=self.plane.shape), resolution)
        np.testing.assert_allclose(points[:, 2], 1, atol=0.01)
        asked = np.random.default_rng(1).uniform(0.1, 1.8, (500, 2))
        gap = np.sqrt(((asked[:, None] - points[None, :, :2]) ** 2).sum(axis=2)).min(axis=1)
        assert gap.max() < 1.1 * resolution
        assert points[:, :2].min() > -0.25

    def test_coarser_than_the_data_each_voxel_has_its_mean(self) -> None:
        points = surface_points(self.plane + 0.05, 0.5)
        assert len(points) == 16
        np.testing.assert_allclose(points.mean(axis=0), self.plane.mean(axis=0) + 0.05)

    def test_the_usual_spacing(self) -> None:
        assert spacing_of(self.plane) == pytest.approx(0.1)
        assert spacing_of(self.plane[:1]) >= 0

    def test_few_points_stay(self) -> None:
        few = self.plane[:3]
        np.testing.assert_allclose(np.sort(surface_points(few, 0.01), axis=0), np.sort(few, axis=0))

    def test_the_resolution_follows_the_picture_and_the_data(self) -> None:
        fine, coarse = picture_resolution(self.plane, 2000), picture_resolution(self.plane, 200)
        assert 0 < fine < coarse == pytest.approx(1.5 * np.hypot(1.9, 1.9) / 200, rel=0.05)

    def test_bad_input(self) -> None:
        for resolution in (0.0, -1.0, np.nan):
            with pytest.raises(InputError, match="resolution"):
                surface_points(self.plane, resolution)
        with pytest.raises(InputError, match="empty"):
            surface_points(np.empty((0, 3)), 0.1)
