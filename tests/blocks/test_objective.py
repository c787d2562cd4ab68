"""What learning minimises: value and gradient against the formulas in double precision and differences of them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.model import BlockModel
from semgp.blocks.objective import Objective, all_free, temperature_free
from semgp.blocks.patches import Patch
from semgp.errors import InputError
from semgp.gp.stationary import Matern12, Matern32, Matern52, SquaredExponential
from tests.blocks.naive import Array, Block, answer

C = 5
PRIOR = (0.35, 0.25, 0.2, 0.15, 0.05)
PLAIN = BlockModel(kernel=Matern52(ell=(0.4,), sf=0.5) + Matern32(ell=(1.5,), sf=0.6), prior=PRIOR)
LEVEL = replace(
    PLAIN, kernel=Matern12(ell=(0.7, 0.7, 0.3), sf=0.6) + SquaredExponential(ell=(2.0, 1.0, 0.5), sf=0.8)
)
FEATURES = replace(
    PLAIN,
    kernel=Matern52(ell=(0.5,), sf=0.6, dims=(0, 1, 2)) + Matern52(ell=(0.9, 1.1, 0.8, 2.0), sf=0.5)
    + Matern32(ell=(1.5, 0.8), sf=0.3, dims=(3, 1)),
    features=("a",),
)  # fmt: skip
MODELS = {
    "pool": PLAIN,
    "indicator": replace(PLAIN, weights=(1.3, 0.0, 0.0), delta=0.05),
    "log-ratio": replace(PLAIN, weights=(0.0, 0.8, 0.0), a=0.6),
    "vote": replace(PLAIN, posterior="vote", weights=(0.0, 0.0, 0.7), v_0=0.4),
    "mostly vote": replace(PLAIN, weights=(0.2, 0.3, 2.0), v_0=0.3, s_n=1.5),
    "ARD": LEVEL,
    "errors": replace(PLAIN, error_rate=0.3, errors=(0.1, 0.1, 0.2, 0.2, 0.4)),
    "other": replace(PLAIN, other=True),
    "errors by other": replace(PLAIN, other=True, error_rate=0.8, error_power=0.7, errors=PRIOR),
    "features": FEATURES,
}


def patches(model: BlockModel) -> list[Patch]:
    """Members of some of the classes, and held-out labels of all of them."""
    n_dims, nothing = model.n_dims, [C] if model.other else []
    rng = np.random.default_rng(n_dims)
    made = []
    every = [0, 1, 2, 3, 4, *nothing]
    for n, present in ((9, [0, 1, 3]), (30, [2, *nothing]), (26, every), (1, [4]), (17, [1, 2, *nothing])):
        mass = rng.dirichlet(np.full(len(present), 0.7), n).T * rng.integers(1, 9, n)
        X, Y = (rng.uniform(0, 2, (n_dims, m)).astype(np.float32) for m in (n, 12))
        k, labels = rng.integers(1, 5, n).astype(np.float32), rng.integers(0, C, 12).astype(np.int32)
        S, SY = np.empty((0, n), np.float32), np.empty((0, 12), np.float32)
        made.append(Patch(X, S, k, np.array(present, np.int16), mass.astype(np.float32), Y, SY, labels))
    return made


def mean_loss(model: BlockModel, all_patches: list[Patch]) -> float:
    losses = []
    for p in all_patches:
        mass = np.zeros((len(p.k), C + model.other))
        mass[:, p.present] = p.mass.T
        block = Block(p.X.T.astype(np.float64), mass, p.k.astype(np.float64))
        chance = answer(model, block, p.Y.T.astype(np.float64)).probability
        losses.append(-np.log(chance[np.arange(len(p.label)), p.label]).mean())
    return float(np.mean(losses))


def differences(objective: Objective, all_patches: list[Patch], x: Array, spread: float) -> Array:
    """Central differences of loss and prior, both written anew."""

    def value(x: Array) -> float:
        return mean_loss(objective.model(x), all_patches) + 0.5 * float(x @ x) / spread**2 / len(all_patches)

    step = 1e-5 * np.eye(len(x))
    return np.array([(value(x + s) - value(x - s)) / 2e-5 for s in step])


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("which", ["each", "all free", "temperature"])
def test_value_and_gradient(name: str, which: str) -> None:
    start = MODELS[name]
    n = len(start.kernel.theta) + 9
    free = {"each": np.eye(n), "all free": all_free(start, vertical=2), "temperature": temperature_free(start)}[
        which
    ]
    all_patches = patches(start)
    objective = Objective(start, all_patches, free, 0.7, None)
    x = np.random.default_rng(1).normal(scale=0.2, size=free.shape[1])
    value, gradient = objective(x)
    expected = mean_loss(objective.model(x), all_patches)
    assert value - objective.penalty(x) == pytest.approx(expected, rel=2e-5)
    np.testing.assert_allclose(gradient, differences(objective, all_patches, x, 0.7), rtol=2e-3, atol=2e-5)


def test_gradient_is_that_of_the_compiled_value() -> None:
    free = all_free(PLAIN, None)
    objective = Objective(PLAIN, patches(PLAIN), free, 0.7, None)
    x = np.full(free.shape[1], 0.1)
    _, gradient = objective(x)
    steps = 0.01 * np.eye(len(x))
    expected = np.array([(objective(x + s)[0] - objective(x - s)[0]) / 0.02 for s in steps])
    np.testing.assert_allclose(gradient, expected, rtol=0.03, atol=1e-3)
    assert objective.evaluations == 1 + 2 * len(x)


def test_start_and_prior() -> None:
    calls: list[tuple[int, float]] = []
    objective = Objective(PLAIN, patches(PLAIN), all_free(PLAIN, None), 0.5, lambda n, v: calls.append((n, v)))
    zero = np.zeros(all_free(PLAIN, None).shape[1])
    again = objective.model(zero)
    np.testing.assert_allclose(again.kernel.theta, PLAIN.kernel.theta)
    assert again.powers == pytest.approx(PLAIN.powers)
    assert objective.penalty(zero) == 0
    assert objective.penalty(zero + 0.5) == pytest.approx(0.5 * len(zero) / 5)
    value, _ = objective(zero)
    assert calls == [(1, value)]


def columns(free: Array) -> list[list[int]]:
    assert set(np.unique(free).tolist()) <= {0.0, 1.0}
    return [np.flatnonzero(column).tolist() for column in free.T]


class TestFree:
    """Parameters: theta, then s_n, nugget, a, delta, v_0, three powers and the error rate."""

    @pytest.mark.parametrize(
        ("vertical", "first"),
        [
            (2, [[0, 1], [2], [3], [4, 5], [6], [7]]),
            (0, [[1, 2], [0], [3], [5, 6], [4], [7]]),
            (None, [[i] for i in range(8)]),
        ],
    )
    def test_horizontal_length_scales_move_together(self, vertical: int | None, first: list[list[int]]) -> None:
        assert columns(all_free(LEVEL, vertical))[: len(first)] == first

    def test_features_and_single_length_scales_move_alone(self) -> None:
        groups = columns(all_free(FEATURES, 2))
        assert groups[:9] == [[0], [1], [2, 3], [4], [5], [6], [7], [8], [9]]

    @pytest.mark.parametrize(
        ("name", "rest"),
        [("pool", range(4, 12)), ("indicator", [4, 5, 7, 9]), ("vote", [8, 11]), ("errors", range(4, 13))],
    )
    def test_powers_of_zero_stay(self, name: str, rest: Sequence[int]) -> None:
        assert columns(all_free(MODELS[name], None))[4:] == [[i] for i in rest]

    def test_temperature_is_one_factor_of_all_powers(self) -> None:
        objective = Objective(PLAIN, patches(PLAIN), temperature_free(PLAIN), 0.7, None)
        warm = objective.model(np.array([np.log(2.0)]))
        assert warm.powers == pytest.approx([2 * w for w in PLAIN.powers])
        assert replace(warm, weights=PLAIN.weights) == replace(PLAIN, kernel=warm.kernel)

    @pytest.mark.parametrize("vertical", [3, -1, "z"])
    @pytest.mark.parametrize("name", ["pool", "ARD"])
    def test_a_vertical_that_is_no_axis(self, name: str, vertical: int) -> None:
        with pytest.raises(InputError, match="axis 0, 1 or 2, or None"):
            all_free(MODELS[name], vertical)

    @pytest.mark.parametrize("posterior", ["dirichlet", "laplace", "ep", "softmax"])
    def test_experts_are_not_learned_so(self, posterior: str) -> None:
        with pytest.raises(InputError, match="not learned by trials"):
            all_free(replace(PLAIN, posterior=posterior, weights=None), None)


def test_patches_may_have_different_numbers_of_points() -> None:
    def cut(p: Patch, m: int) -> Patch:
        Y: NDArray[np.float32] = np.ascontiguousarray(p.Y[:, :m])
        return p._replace(Y=Y, label=p.label[:m])

    uneven = [cut(p, m) for p, m in zip(patches(PLAIN), (1, 12, 5, 7, 2))]
    objective = Objective(PLAIN, uneven, np.eye(13), 0.7, None)
    assert objective(np.zeros(13))[0] == pytest.approx(mean_loss(PLAIN, uneven), rel=2e-5)
