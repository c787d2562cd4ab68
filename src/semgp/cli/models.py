"""Models in words: kernel, noise and inference of a GP map."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from semgp.blocks.model import EXPERTS, BlockModel
from semgp.classes import Classes
from semgp.gp.kernels import Kernel, Product, Sum
from semgp.gp.model import GPModel
from semgp.gp.stationary import Stationary

AXES = ("x", "y", "z")
FAMILIES = {
    "Matern12": "Matérn 1/2",
    "Matern32": "Matérn 3/2",
    "Matern52": "Matérn 5/2",
    "SquaredExponential": "squared exponential",
}
INFERENCE = {
    "laplace": "Laplace, one class against the rest",
    "ep": "expectation propagation, one class against the rest",
    "softmax": "softmax over all classes, Laplace",
}
PREDICTORS = ("indicators", "log-ratios", "vote")


def model_rows(model: BlockModel | GPModel, classes: Classes) -> Iterator[tuple[str, str]]:
    """Yield what a model is, each line with its heading."""
    if isinstance(model, BlockModel):
        yield "kernel", kernel_words(model.kernel, model.features)
        yield (
            "noise",
            f"variance {model.s_n:.3g} a label, and {model.nugget:.3g} a site however many labels it has",
        )
        yield "posterior", _posterior(model)
        return
    kernels = [kernel_words(kernel) for kernel in model.kernels]
    if len(kernels) == 1:
        yield "kernel", kernels[0]
    else:
        yield "kernel", "\n".join(f"{name}: {words}" for name, words in zip(classes.names, kernels, strict=True))
    means = (
        f"{min(model.m):.3g}" if len(set(model.m)) == 1 else f"{min(model.m):.3g} to {max(model.m):.3g}, by class"
    )
    yield "mean", means
    inducing = "dense" if model.n_inducing is None else f"{model.n_inducing:,} inducing points (FITC)"
    points = f"at most {model.max_points:,} training points"
    yield "posterior", f"{INFERENCE[model.inference]}; {model.likelihood} likelihood; {inducing}; {points}"


def kernel_words(kernel: Kernel, features: Sequence[str] = ()) -> str:
    """Return a kernel in words, with its length scales, in metres along axes, and its signal deviation."""
    if isinstance(kernel, Sum):
        return f"{kernel_words(kernel.left, features)}\n+ {kernel_words(kernel.right, features)}"
    if isinstance(kernel, Product):
        parts = (kernel_words(part, features) for part in (kernel.left, kernel.right))
        return " x ".join(f"({part})" for part in parts)
    if isinstance(kernel, Stationary):
        family = FAMILIES.get(type(kernel).__name__, type(kernel).__name__)
        return f"{family}, {_lengths(kernel, (*AXES, *features))}, signal deviation {kernel.sf:.3g}"
    return type(kernel).__name__


def _lengths(kernel: Stationary, names: Sequence[str]) -> str:
    """The length scales with their units; one that serves several inputs stands once."""
    inputs = [names[d] for d in (range(len(names)) if kernel.dims is None else kernel.dims)]
    unit = " m" if set(inputs) <= set(AXES) else ""
    if len(kernel.ell) == 1:
        along = "" if inputs == list(AXES) else f" along {', '.join(inputs)}"
        return f"length scale {kernel.ell[0]:.3g}{unit}{along}"
    scales = (f"{ell:.3g}{' m' if name in AXES else ''} along {name}" for ell, name in zip(kernel.ell, inputs))
    return f"length scales {', '.join(scales)}"


def _posterior(model: BlockModel) -> str:
    """How blocks are solved, and how large they are."""
    if model.posterior in EXPERTS:
        how = f"{model.posterior}, block by block"
    else:
        powers = ", ".join(f"{name} {w:.2g}" for name, w in zip(PREDICTORS, model.powers, strict=True) if w > 0)
        how = f"pool of predictors to their powers: {powers}"
    return f"{how}; blocks of at most {model.leaf} own sites, {model.near} near and {model.far} coarse ones"
