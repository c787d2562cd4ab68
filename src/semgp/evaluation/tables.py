"""Tables of an experiment in HTML: our numbers, and those of others beside them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from statistics import fmean

from semgp.classes import Classes
from semgp.evaluation.names import method_name
from semgp.evaluation.published import REFERENCES, Reference
from semgp.evaluation.task import Result

SCORES = {"accuracy": "accuracy", "miou": "mIoU", "nll": "NLL", "ece": "ECE", "coverage": "coverage"}
COSTS = {"n_train": "labels", "fit_seconds": "build, s", "query_seconds": "query, s", "peak_rss_mb": "peak MB"}
LESS_IS_BETTER = frozenset({"nll", "ece"})
UNKNOWN = "–"


def table(head: Sequence[str], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """Return a table; each row is its kind, a class of the style sheet, and its cells, which are HTML already."""
    lines = ["<table>", "<thead>" + _row("", head, "th") + "</thead>", "<tbody>"]
    lines += [_row(kind, cells, "td") for kind, cells in rows]
    return "\n".join([*lines, "</tbody>", "</table>"])


def score_table(results: Sequence[Result]) -> str:
    """Return one experiment's table: a row a method, and below it what others published or measured of it.

    AUC of each scene, then the means over the scenes. Our best value in each column is bold.
    """
    scenes = list(dict.fromkeys(result.frame for result in results))
    scenes = scenes if len(scenes) > 1 else []
    methods = _by_method(results)
    means = {method: _means(of_method) for method, of_method in methods.items()}
    auc = {method: {r.frame: r.scores.auc_total for r in of_method} for method, of_method in methods.items()}
    best = {name: _best(name, [mean[name] for mean in means.values()]) for name in ("auc", *SCORES)}
    best |= {scene: _best("auc", [of[scene] for of in auc.values() if scene in of]) for scene in scenes}
    beside = [reference for reference in REFERENCES if any(reference.goes_with(r) for r in results)]
    rows: list[tuple[str, list[str]]] = []
    for method, mean in means.items():
        cells = [escape(method_name(method)), *(_score(auc[method].get(s), best[s]) for s in scenes)]
        cells += [_score(mean[name], best[name]) for name in ("auc", *SCORES)]
        rows.append(("", [*cells, *(f"{mean[name]:,.{0 if mean[name] >= 100 else 2}f}" for name in COSTS)]))
        rows += [("reference", _reference(r, scenes)) for r in beside if r.method == method]
    rows += [("reference apart", _reference(r, scenes)) for r in beside if r.method not in means]
    aucs = [*(f"AUC {escape(scene)}" for scene in scenes), "mean AUC" if scenes else "AUC"]
    return table(["method", *aucs, *SCORES.values(), *COSTS.values()], rows)


def class_table(results: Sequence[Result], classes: Classes) -> str:
    """Return the IoU of each class present: the mean over the scenes that have it, a row a method."""
    rows = []
    for method, of_method in _by_method(results).items():
        iou = [[v for v in column if not math.isnan(v)] for column in zip(*(r.scores.iou for r in of_method))]
        rows.append((method, iou))
    present = [c for c, _ in enumerate(classes.names) if any(iou[c] for _, iou in rows)]
    body = [("", [escape(method_name(m)), *(_score(_mean(iou[c])) for c in present)]) for m, iou in rows]
    return table(["method", *(escape(classes.names[c]) for c in present)], body)


def scene_table(results: Sequence[Result]) -> str:
    """Return all results, a row each, with the scores of the points that the map has observed."""
    rows = []
    for result in results:
        seen = result.scores.on_observed
        row = result.row()
        scores = [row[name] for name in ("auc", *SCORES)] + [result.scores.auc_hand_till, result.scores.brier]
        of_seen = [seen.auc_total, seen.accuracy, seen.miou, seen.nll] if seen else [None] * 4
        who = escape(f"{result.frame}, {method_name(result.method)}")
        cells = [who, *map(_score, (*scores, *of_seen))]
        rows.append(("", [*cells, f"{row['n_query']:,}"]))
    observed = [f"{name}, observed" for name in ("AUC", "accuracy", "mIoU", "NLL")]
    head = ["scene, method", "AUC", *SCORES.values(), "Hand &amp; Till", "Brier", *observed, "queries"]
    return table(head, rows)


def sources(results: Sequence[Result]) -> list[str]:
    """Return where the numbers of others that go with these results come from."""
    return list(dict.fromkeys(r.source for r in REFERENCES if any(r.goes_with(result) for result in results)))


def _reference(reference: Reference, scenes: Sequence[str]) -> list[str]:
    """The cells of numbers by others; their mean AUC is known if those of all scenes are."""
    auc = [reference.auc.get(scene) for scene in scenes]
    mean = None if None in auc else _mean([v for v in auc if v is not None])
    known = [*auc, mean, *(reference.scores.get(name) for name in SCORES)]
    return [escape(reference.label), *("" if v is None else _score(v) for v in known), *("" for _ in COSTS)]


def _by_method(results: Sequence[Result]) -> dict[str, list[Result]]:
    methods = dict.fromkeys(result.method for result in results)
    return {method: [result for result in results if result.method == method] for method in methods}


def _means(results: Sequence[Result]) -> Mapping[str, float]:
    rows = [result.row() for result in results]
    return {name: fmean(row[name] for row in rows) for name in ("auc", *SCORES, *COSTS)}


def _mean(values: Sequence[float]) -> float | None:
    return fmean(values) if values else None


def _best(name: str, values: Sequence[float]) -> str:
    """The best of some scores as it is printed: what prints alike is equally good."""
    known = [value for value in values if not math.isnan(value)]
    if len(known) < 2 or name == "coverage":
        return ""
    return f"{(min if name in LESS_IS_BETTER else max)(known):.4f}"


def _score(value: float | None, best: str = "") -> str:
    if value is None or math.isnan(value):
        return UNKNOWN
    text = f"{value:.4f}"
    return f"<b>{text}</b>" if text == best else text


def _row(kind: str, cells: Sequence[str], tag: str) -> str:
    label = f' class="{kind}"' if kind else ""
    return f"<tr{label}>" + "".join(f"<{tag}>{cell}</{tag}>" for cell in cells) + "</tr>"
