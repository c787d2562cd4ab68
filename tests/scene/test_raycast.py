"""Ray casting against geometry."""

import numpy as np
import pytest

from semgp.errors import InputError
from semgp.scene.raycast import BOX, CYLINDER, ELLIPSOID, Solids, cast
from semgp.scene.shading import shade
from tests.scene.solids import inside

Vector = tuple[float, float, float]


def one(shape: int, half: Vector, yaw: float = 0.0) -> Solids:
    """Return a single solid around the origin."""
    return Solids(np.array([shape]), np.zeros((1, 3)), np.array([half]), np.array([yaw]))


@pytest.mark.parametrize(
    ("solids", "origin", "direction", "distance", "normal"),
    [
        (one(ELLIPSOID, (2, 2, 2)), (-5, 0, 0), (1, 0, 0), 3, (-1, 0, 0)),
        (one(ELLIPSOID, (2, 2, 2)), (-5, 1, 0), (1, 0, 0), 5 - 3**0.5, (-(3**0.5) / 2, 0.5, 0)),
        (one(ELLIPSOID, (1, 1, 3)), (0, 0, 9), (0, 0, -2), 3, (0, 0, 1)),
        (one(BOX, (1, 2, 3)), (-5, 0, 0), (1, 0, 0), 4, (-1, 0, 0)),
        (one(BOX, (1, 2, 3)), (0, 0, 10), (0, 0, -1), 7, (0, 0, 1)),
        (one(BOX, (1, 1, 1), np.pi / 4), (-5, 0.1, 0), (1, 0, 0), 5.1 - 2**0.5, (-(0.5**0.5), 0.5**0.5, 0)),
        (one(CYLINDER, (1, 1, 2)), (-5, 0.6, 1), (1, 0, 0), 4.2, (-0.8, 0.6, 0)),
        (one(CYLINDER, (1, 1, 2)), (0.5, 0, -6), (0, 0, 1), 4, (0, 0, -1)),
        (one(CYLINDER, (1, 1, 2)), (-3, 0, 5), (1, 0, -1), 3, (0, 0, 1)),
    ],
)
def test_distances_and_normals_are_those_of_geometry(
    solids: Solids, origin: Vector, direction: Vector, distance: float, normal: Vector
) -> None:
    hits = cast(solids, origin, np.array([direction], dtype=float))
    assert hits.solid[0] == 0
    np.testing.assert_allclose(hits.distance[0], distance, rtol=1e-12)
    np.testing.assert_allclose(hits.normal[0], normal, atol=1e-12)


@pytest.mark.parametrize("shape", [BOX, ELLIPSOID, CYLINDER])
@pytest.mark.parametrize(
    ("origin", "direction"), [((-5, 0, 2), (1, 0, 0)), ((-5, 0, 0), (-1, 0, 0)), ((3, 0, 9), (0, 0, -1))]
)
def test_rays_that_pass_by_or_lead_away_hit_nothing(shape: int, origin: Vector, direction: Vector) -> None:
    hits = cast(one(shape, (1, 1, 1)), origin, np.array([direction], dtype=float))
    assert hits.solid[0] == -1
    assert np.isinf(hits.distance[0])
    assert not hits.normal.any()


def test_first_hit_is_where_a_march_along_the_ray_first_enters_a_solid() -> None:
    rng = np.random.default_rng(0)
    n = 12
    solids = Solids(
        rng.integers(0, 3, n), rng.uniform(-2, 2, (n, 3)), rng.uniform(0.2, 0.8, (n, 3)), rng.uniform(0, 6, n)
    )
    origins = rng.normal(0, 1, (200, 3))
    origins *= 8 / np.linalg.norm(origins, axis=1)[:, None]
    directions = rng.uniform(-2, 2, (200, 3)) - origins
    hits = cast(solids, origins, directions)
    steps = np.linspace(0, 2, 4001)
    for o, d, t, s in zip(origins, directions, hits.distance, hits.solid):
        entered = np.array([inside(solids, i, o + steps[:, None] * d) for i in range(n)])
        if entered.any():
            first = entered.any(axis=0).argmax()
            assert steps[first - 1] <= t <= steps[first]
            assert entered[s, first]
        else:  # nothing, or a corner cut within one step
            assert np.isinf(t) or not inside(solids, s, (o + (t + 2e-3) * d)[None])[0]
    hit = hits.solid >= 0
    assert 50 < hit.sum() < 200
    np.testing.assert_allclose(np.linalg.norm(hits.normal[hit], axis=1), 1)
    assert ((hits.normal * directions).sum(axis=1)[hit] < 0).all()


def test_things_throw_shadows() -> None:
    shelf = Solids(np.array([BOX]), np.array([[0.4, -0.3, 1.5]]), np.array([[0.3, 0.3, 0.02]]), np.zeros(1))
    floor = np.array([[0.4, -0.3, 0.0], [1.4, -0.3, 0.0], [2.6, -0.3, 0.0]])  # below the lamp, and beside
    normals, paint = np.tile([0.0, 0, 1], (3, 1)), np.full((3, 3), 200, dtype=np.uint8)
    below, beside, far = shade(shelf, floor, normals, paint)[:, 0].astype(int)
    assert below < far - 15
    assert far < beside


def test_rays_must_fit_each_other() -> None:
    with pytest.raises(InputError, match="directions"):
        cast(one(BOX, (1, 1, 1)), (0, 0, 0), np.zeros(3))
    with pytest.raises(InputError, match="origins"):
        cast(one(BOX, (1, 1, 1)), np.zeros((2, 3)), np.ones((3, 3)))
