"""Uncertain positions: the expected kernel against quadrature, its derivatives, and a map that uses it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from semgp.blocks.arrays import F32
from semgp.blocks.covariance import mixture, stationary_terms
from semgp.blocks.field import Field
from semgp.blocks.inputs import add_cloud
from semgp.blocks.learning import learn_blocks
from semgp.blocks.model import BlockModel
from semgp.blocks.uncertain import cross_covariance, cross_derivative, member_covariance, member_derivative
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.gp.kernels import Kernel
from semgp.gp.stationary import Matern12, Matern32, Matern52, SquaredExponential, Stationary

Array = NDArray[np.float64]
KERNELS: list[Kernel] = [
    SquaredExponential(ell=(0.5, 0.8, 0.3), sf=0.7),
    Matern12(ell=(0.6,), sf=1.1),
    Matern32(ell=(0.5, 0.8, 0.3), sf=0.7),
    Matern52(ell=(0.4,), sf=0.9) + Matern52(ell=(2.0, 2.0, 0.5), sf=0.5),
]
SCALE = {Matern12: 1.0, Matern32: 3.0, Matern52: 5.0, SquaredExponential: 0.5}
FACTOR = {Matern12: 1.6, Matern32: 1.25, Matern52: 1.15, SquaredExponential: 1.0}


def drawn(n: int, seed: int) -> tuple[F32, F32]:
    """Positions (3, n), variances and sets of draws (5, n)."""
    rng = np.random.default_rng(seed)
    S = np.vstack([rng.uniform(0, 0.3, (3, n)), rng.integers(0, 1 << 6, (2, n)) << 18])
    return rng.uniform(0, 1.5, (3, n)).astype(np.float32), S.astype(np.float32)


def members(kernel: Kernel, X: F32, S: F32, i: int, j: int) -> float:
    """Covariance of two means over sets of draws, pair by pair."""
    sets = [[(row, bit) for row in (3, 4) for bit in range(24) if int(S[row, m]) >> bit & 1] for m in (i, j)]
    if i == j and not sets[0]:
        sets = [[(0, 0)], [(0, 0)]]
    together = naive(kernel, X[:, i], X[:, j], (np.sqrt(S[:3, i]) - np.sqrt(S[:3, j])) ** 2)
    apart = naive(kernel, X[:, i], X[:, j], S[:3, i] + S[:3, j])
    pairs = [together if a == b else apart for a in sets[0] for b in sets[1]]
    return float(np.mean(pairs)) if pairs else apart


def naive(kernel: Kernel, x_: ArrayLike, y_: ArrayLike, s: ArrayLike) -> float:
    """The expected kernel of two points whose variances add up to s (3,), term by term."""
    x, y, total = np.asarray(x_, dtype=np.float64), np.asarray(y_, dtype=np.float64), 0.0
    for term in stationary_terms(kernel):
        ell2 = np.broadcast_to(np.asarray(term.ell) ** 2, 3)
        v = ell2 + FACTOR[type(term)] * np.asarray(s, dtype=np.float64)
        r2 = SCALE[type(term)] * ((x - y) ** 2 / v).sum()
        t = np.sqrt(r2)
        shape = {
            Matern12: np.exp(-t),
            Matern32: (1 + t) * np.exp(-t),
            Matern52: (1 + t + t * t / 3) * np.exp(-t),
            SquaredExponential: np.exp(-r2),
        }[type(term)]
        total += float(term.sf**2 * np.sqrt(np.prod(ell2 / v)) * shape)
    return total


@pytest.mark.parametrize("kernel", KERNELS, ids=str)
def test_against_the_rule_written_out(kernel: Kernel) -> None:
    (X, SX), (Y, SY) = drawn(9, 0), drawn(7, 1)
    K, work = np.empty((9, 7), np.float32), np.empty(9, np.float32)
    compiled = mixture(kernel, 3)
    for S_X, S_Y in ((SX, SY), (SX, SY[:0]), (SX[:0], SY)):
        cross_covariance(X, S_X, 9, Y, S_Y, 7, compiled, K, work)
        for i in range(9):
            for j in range(7):
                s = (S_X[:3, i] if len(S_X) else 0) + (S_Y[:3, j] if len(S_Y) else np.zeros(3))
                assert K[i, j] == pytest.approx(
                    naive(kernel, X[:, i].astype(float), Y[:, j].astype(float), s), rel=2e-5
                )
    A = np.empty((9, 9), np.float32)
    member_covariance(X, SX, 9, compiled, A, work)
    for i in range(9):
        for j in range(i + 1):
            assert A[i, j] == pytest.approx(members(kernel, X, SX, i, j), rel=3e-5)


def test_the_squared_exponential_is_the_expectation_itself() -> None:
    """Gauss-Hermite quadrature over the difference of two uncertain points."""
    kernel = SquaredExponential(ell=(0.5, 0.8, 0.3), sf=0.7)
    x, y, s = np.array([0.1, 0.4, 0.2]), np.array([0.5, 0.1, 0.6]), np.array([0.2, 0.1, 0.05])
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    total = 0.0
    for i, a in enumerate(nodes):
        for j, b in enumerate(nodes):
            moved = y + np.sqrt(s) * np.array([a, b, 0])
            up = np.array([[0, 0, np.sqrt(s[2]) * c] for c in nodes])
            inner = np.array([naive(kernel, x, moved + v, np.zeros(3)) for v in up])
            total += weights[i] * weights[j] * float(weights @ inner)
    assert naive(kernel, x, y, s) == pytest.approx(total / np.sqrt(2 * np.pi) ** 3, rel=1e-9)


@pytest.mark.parametrize(("kernel", "worst"), [(Matern52, 0.04), (Matern32, 0.065), (Matern12, 0.195)])
def test_for_matern_it_is_close_to_the_expectation(kernel: type[Stationary], worst: float) -> None:
    draws, zero = np.random.default_rng(0).normal(size=(20_000, 3)), np.zeros(3)
    term = kernel(ell=(1.0,), sf=1.0)
    for sd in (0.1, 0.25, 0.5, 1.0, 2.5):
        for distance in (0.0, 0.5, 1.0, 2.0):
            y = np.array([distance, 0, 0])
            expectation = term(y + sd * draws, zero[None]).mean()
            assert naive(term, zero, y, np.full(3, sd**2)) == pytest.approx(expectation, abs=worst)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(KERNELS))
def test_it_is_positive_definite(seed: int, kernel: Kernel) -> None:
    X, S = drawn(25, seed)
    S[:3] *= np.random.default_rng(seed).choice([0, 1, 50], 25)
    A = np.empty((25, 25), np.float32)
    member_covariance(X, S.astype(np.float32), 25, mixture(kernel, 3), A, np.empty(25, np.float32))
    lower = np.tril(A)
    assert np.linalg.eigvalsh(lower + np.tril(lower, -1).T).min() > -1e-5


@pytest.mark.parametrize("kernel", KERNELS, ids=str)
def test_derivatives(kernel: Kernel) -> None:
    """Central differences of the sum of H times the kernel, in each logarithm."""
    (X, SX), (Y, SY) = drawn(6, 2), drawn(5, 3)
    rng = np.random.default_rng(4)
    H, HA = rng.normal(size=(6, 5)).astype(np.float32), rng.normal(size=(6, 6)).astype(np.float32)
    compiled = mixture(kernel, 3)
    out = np.zeros((len(compiled.kind), 4))
    cross_derivative(X, SX, 6, Y, SY, 5, compiled, H, 1.0, out, np.empty(6, np.float32))
    member_derivative(X, SX, 6, compiled, HA, -1.0, out, np.empty(6, np.float32))

    def value(k: Kernel) -> float:
        a = sum(H[i, j] * naive(k, X[:, i], Y[:, j], SX[:3, i] + SY[:3, j]) for i in range(6) for j in range(5))
        b = sum(HA[i, j] * members(k, X, SX, i, j) for i in range(6) for j in range(6))
        return float(a - b)

    at = 0
    for k, term in enumerate(stationary_terms(kernel)):
        n_ell = len(term.ell)
        for p in range(n_ell + 1):
            step = np.zeros(len(kernel.theta))
            step[at + p] = 1e-4
            slope = (
                value(kernel.with_theta(kernel.theta + step)) - value(kernel.with_theta(kernel.theta - step))
            ) / 2e-4
            found = out[k, 3] if p == n_ell else out[k, :3].sum() if n_ell == 1 else out[k, p]
            assert found == pytest.approx(slope, abs=5e-3)
        at += n_ell + 1


TWO = Classes(("left", "right"))
MODEL = BlockModel(kernel=Matern52(ell=(0.3,), sf=0.5) + Matern52(ell=(1.5,), sf=0.4), resolution=0.1)


def blurred(sd: float, seed: int, known: bool) -> LabelledCloud:
    """A floor of two halves, of which every point was seen a little beside its place."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-1, 1, (400, 2)), np.zeros(400)])
    labels = (points[:, 0] > 0).astype(np.int32)
    moved = points + sd * rng.normal(size=points.shape)
    return LabelledCloud(
        moved, TWO, labels, covariances=np.tile(sd**2 * np.eye(3), (400, 1, 1)) if known else None
    )


def filled(*clouds: LabelledCloud, model: BlockModel = MODEL) -> Field:
    field = Field(model, 2)
    for cloud in clouds:
        add_cloud(field, cloud)
    return field


def test_certain_positions_with_a_covariance_of_zero_change_nothing() -> None:
    X = np.column_stack([np.linspace(-1, 1, 50), np.zeros(50), np.zeros(50)])
    none = np.empty((50, 0), np.float32)
    plain, zero = (filled(blurred(0.0, 1, known)).query(X, none) for known in (False, True))
    assert np.allclose(plain.probability, zero.probability, atol=1e-5)
    assert np.allclose(plain.variance, zero.variance, atol=1e-5)


def test_far_off_points_count_less_than_sure_ones() -> None:
    """Many uncertain labels say one thing near a few certain ones that say another."""
    rng = np.random.default_rng(0)
    wrong = LabelledCloud(
        rng.normal(scale=0.4, size=(60, 3)), TWO, np.ones(60, np.int32), covariances=np.tile(np.eye(3), (60, 1, 1))
    )
    right = LabelledCloud(rng.normal(scale=0.1, size=(20, 3)), TWO, np.zeros(20, np.int32))
    X, none = np.zeros((1, 3)), np.empty((1, 0), np.float32)
    ignoring = filled(replace(wrong, covariances=None), right).query(X, none)
    knowing = filled(wrong, right).query(X, none)
    assert knowing.probability[0, 0] > ignoring.probability[0, 0] + 0.02
    assert (
        filled(wrong).query(X, none).variance[0]
        > filled(replace(wrong, covariances=None)).query(X, none).variance[0]
    )


def test_uncertain_positions_survive_saving() -> None:
    field = filled(blurred(0.2, 0, True))
    again = Field(MODEL, 2)
    again.restore(field.sites.to_arrays())
    X, none = np.random.default_rng(0).uniform(-1, 1, (30, 3)), np.empty((30, 0), np.float32)
    assert np.array_equal(field.query(X, none).probability, again.query(X, none).probability)


def test_learning_takes_them_into_account() -> None:
    """With blurred labels and judges, knowing the blur gives shorter length scales than not knowing."""
    models = []
    for known in (False, True):
        trial = ([blurred(0.25, s, known) for s in (0, 1)], [blurred(0.25, s, known) for s in (2, 3)])
        models.append(learn_blocks([trial], MODEL, patches=40, max_iterations=8)[0])
    plain, informed = (np.exp(m.kernel.theta[0]) for m in models)
    assert informed < plain


def test_bad_input() -> None:
    cloud = blurred(0.1, 0, True)
    with pytest.raises(InputError, match="positions must be known to 10 m"):
        filled(replace(cloud, covariances=np.tile(200 * np.eye(3), (400, 1, 1))))
    with pytest.raises(InputError, match="take positions as certain"):
        filled(cloud, model=replace(MODEL, posterior="laplace", weights=None))
    with pytest.raises(InputError, match="without negative eigenvalues"):
        replace(cloud, covariances=np.tile(np.diag([1.0, -1, 1]), (400, 1, 1)))
    with pytest.raises(InputError, match="NaN"):
        replace(cloud, covariances=np.full((400, 3, 3), np.nan))
    with pytest.raises(InputError, match="needs T_world_sensor"):
        replace(cloud, pose_covariance=np.eye(6))
