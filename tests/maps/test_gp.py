"""The GP map: what the model says, learning, unknown space, classes never seen."""

from dataclasses import replace

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.gp.hyperparameters import Bounds
from semgp.gp.model import GPModel
from semgp.gp.stationary import Matern32, Matern52
from semgp.maps.gp import GPSemanticMap
from semgp.maps.learning import learn_model

MODELS = {
    "the paper's": GPModel(n_inducing=60),
    "logistic": GPModel(n_inducing=60, likelihood="logistic"),
    "dense": GPModel(n_inducing=None),
    "ep": GPModel(n_inducing=None, inference="ep", max_points=80),
    "ep logistic": GPModel(n_inducing=None, inference="ep", likelihood="logistic", max_points=60),
    "softmax": GPModel(n_inducing=None, inference="softmax", max_points=120),
    "a kernel each": GPModel(
        n_inducing=60, kernels=tuple(Matern52(ell=(ell,), sf=4.0) for ell in (0.5, 0.7, 0.4)), m=(-1.0, -0.5, -2.0)
    ),
    "a sum": GPModel(n_inducing=60, kernels=(Matern52(ell=(0.5,), sf=3.0) + Matern32(ell=(3.0,), sf=1.0),)),
}


def gp_map(model: GPModel, *clouds: LabelledCloud) -> GPSemanticMap:
    made = GPSemanticMap(clouds[0].classes, model)
    for cloud in clouds:
        made.update(cloud)
    return made


def nlml(made: GPSemanticMap) -> float:
    made.solve()
    return float(made.info()["nlml"])


@pytest.mark.parametrize("rule", ["softmax", "plug-in", "averaged"])
@pytest.mark.parametrize("name", MODELS)
def test_every_model_maps(name: str, rule: str, corner: LabelledCloud) -> None:
    made = gp_map(replace(MODELS[name], rule=rule), corner)
    prediction = made.query(corner.points)
    known = corner.labelled
    assert made.info()["converged"]
    assert (prediction.label[known] == corner.hard_labels[known]).mean() > 0.9
    np.testing.assert_allclose(prediction.probability.sum(axis=1), 1, rtol=1e-9)
    assert prediction.variance is not None
    assert (prediction.variance > 0).all()


@pytest.mark.parametrize("name", MODELS)
def test_models_round_trip_through_json(name: str) -> None:
    assert GPModel.from_json(MODELS[name].to_json()) == MODELS[name]


def test_unknown_space_is_said(corner: LabelledCloud) -> None:
    made = gp_map(GPModel(n_inducing=60), corner)
    near, far = made.query(corner.points), made.query(corner.points + 100.0)
    assert near.observed.mean() > 0.95
    assert not far.observed.any()
    assert (far.label == -1).all()
    assert far.entropy.mean() > near.entropy.mean()
    assert far.variance is not None
    np.testing.assert_allclose(far.variance, 25.0, rtol=1e-6)


def test_a_class_never_seen_has_the_weight_of_one_observation(corner: LabelledCloud) -> None:
    classes = Classes((*corner.classes.names, "unicorn"))
    prediction = gp_map(GPModel(n_inducing=60), replace(corner, classes=classes)).query(corner.points)
    n = np.count_nonzero(corner.labelled)
    np.testing.assert_allclose(prediction.probability[:, 3], 1 / (n + 4))
    np.testing.assert_allclose(prediction.probability.sum(axis=1), 1)


def test_at_most_max_points_train(corner: LabelledCloud) -> None:
    made = gp_map(GPModel(n_inducing=20, max_points=50), corner)
    made.solve()
    assert made.info()["training_points"] == 50


def test_updates_do_not_change_the_model(corner: LabelledCloud) -> None:
    model = GPModel(n_inducing=20)
    made = gp_map(model, corner, corner)
    made.query(corner.points)
    assert made.model is model


class TestLearning:
    def test_a_new_model_fits_better(self, corner: LabelledCloud) -> None:
        model = GPModel(n_inducing=40)
        learned, (run,) = learn_model(corner, model, bounds=Bounds(ell=(0.05, 5), sf=(0.1, 10)), max_iterations=15)
        assert model == GPModel(n_inducing=40)
        assert len(learned.kernels) == 1
        assert len(learned.m) == len(corner.classes)
        assert run.nlml < nlml(gp_map(model, corner))
        assert nlml(gp_map(learned, corner)) == pytest.approx(run.nlml, rel=1e-6)

    def test_a_kernel_for_each_class(self, corner: LabelledCloud) -> None:
        learned, runs = learn_model(corner, GPModel(n_inducing=40), per_class=True, max_iterations=5)
        assert len(runs) == len(learned.kernels) == 3
        assert len(set(learned.kernels)) == 3
        assert nlml(gp_map(learned, corner)) == pytest.approx(sum(run.nlml for run in runs), rel=1e-6)

    def test_a_single_class_cannot_be_learned_from(self, corner: LabelledCloud) -> None:
        with pytest.raises(InputError, match="at least two"):
            learn_model(corner[corner.hard_labels == 0])

    def test_no_labels_cannot_be_learned_from(self, corner: LabelledCloud) -> None:
        with pytest.raises(InputError, match="labels"):
            learn_model(replace(corner, labels=np.full(len(corner), -1)))


class TestBadModels:
    @pytest.mark.parametrize(
        "settings",
        [
            {"likelihood": "cauchy"},
            {"inference": "mcmc"},
            {"inference": "ep"},
            {"inducing": "grid"},
            {"rule": "max"},
            {"max_points": 0},
            {"n_inducing": 0},
            {"kernels": ()},
        ],
    )
    def test_settings(self, settings: dict) -> None:  # type: ignore[type-arg]
        with pytest.raises(InputError):
            GPModel(**settings)

    def test_for_another_number_of_classes(self, corner: LabelledCloud) -> None:
        with pytest.raises(InputError, match="do not fit 3 classes"):
            GPSemanticMap(corner.classes, GPModel(m=(0.0, 1.0)))

    @pytest.mark.parametrize("plain", [{}, {"kernels": [{"name": "Cosine"}], "m": [0]}, {"kernels": 3, "m": 4}])
    def test_json(self, plain: dict) -> None:  # type: ignore[type-arg]
        with pytest.raises(InputError, match=r"model|kernel"):
            GPModel.from_json(plain)
