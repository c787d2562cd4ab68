"""A report of an experiment: one HTML page that holds its tables, figures, settings and versions."""

from __future__ import annotations

import base64
import platform
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from html import escape
from importlib.metadata import version
from pathlib import Path

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.evaluation.figures import Figure
from semgp.evaluation.tables import class_table, scene_table, score_table, sources
from semgp.evaluation.task import Result
from semgp.parallel import n_workers
from semgp.writers import atomic_write

PAGE_NAME = "report.html"
PACKAGES = ("semgp", "numpy", "scipy", "numba", "pillow")
STYLE = """
:root { color-scheme: light; --ink: #1d2126; --faint: #69707a; --line: #d9dce1; --tint: #f4f6f8; }
body { margin: 0 auto; padding: 2rem 1.5rem 4rem; max-width: 84rem; color: var(--ink); background: #fff;
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; } h2 { font-size: 1.25rem; margin: 2.4rem 0 .6rem; }
p { max-width: 48rem; } figcaption, ul { color: var(--faint); font-size: .88rem; }
div.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .84rem; font-variant-numeric: tabular-nums; white-space: nowrap; }
th, td { padding: .3rem .6rem; text-align: right; } th:first-child, td:first-child { text-align: left; }
th { font-weight: 600; border-bottom: 2px solid var(--ink); white-space: normal; vertical-align: bottom; }
td { border-bottom: 1px solid var(--line); } tbody tr:hover { background: var(--tint); }
tr.reference td { color: var(--faint); font-style: italic; } tr.reference td:first-child { padding-left: 1.8rem; }
tr.apart td:first-child { padding-left: .6rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1.4rem; font-size: .88rem; }
dt { color: var(--faint); } dd { margin: 0; overflow-wrap: anywhere; }
figure { margin: 1.6rem 0 2.2rem; } figure img { max-width: 100%; height: auto; display: block; }
figcaption { margin-top: .5rem; max-width: 60rem; } summary { cursor: pointer; margin: .8rem 0; }
@media print { body { max-width: none; padding: 0; font-size: 11px; } figure, tr { break-inside: avoid; } }
"""

NOTE = """<p>Each score is over all points whose true label is known. Where a map has observed nothing, every
class scores zero and the answer is wrong. AUC is the mean over the classes present of the one-vs-rest AUC; NLL is
in nats, probabilities floored at 10<sup>-6</sup>; ECE has 15 bins, and answers withheld, wrong and with
probability zero, lower it: read it with the coverage. All but NLL, labels and costs lie between 0 and 1. Our best
value in a column is bold.</p>"""


def write_report(
    folder: str | Path,
    results: Sequence[Result],
    figures: Sequence[Figure] = (),
    *,
    title: str,
    settings: Mapping[str, object],
    seed: int,
    command: str = "",
    classes: Classes | None = None,
) -> Path:
    """Write a page of an experiment's results, and beside it each figure as a file of its own.

    The page, `report.html`, holds all that it shows: no scripts, no other files, nothing from the network. Numbers
    published by others stand below ours where they are known; see `semgp.evaluation.published`.

    Parameters
    ----------
    folder : str or Path
        Where to write; made if it is not there.
    results : sequence of Result
        Results of one or more experiments, at least one.
    figures : sequence of Figure, optional
        Figures, in their order.
    title : str
        Heading of the page.
    settings : mapping
        What else was chosen, by name.
    seed : int
        Seed of all that was drawn.
    command : str, optional
        The command line that made the results.
    classes : Classes, optional
        Those that were scored: names for a table of each class's IoU, which is left out without them.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    InputError
        No results, two figures of one name, or a folder that cannot be made.
    """
    if not results:
        raise InputError("a report needs results: run at least one method.")
    names = [figure.name for figure in figures]
    if len(set(names)) < len(names):
        raise InputError(f"two figures of a report share a name: {', '.join(sorted(names))}.")
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder of the report: {error}.") from error
    facts = {
        "command": command,
        "seed": seed,
        **settings,
        "made": datetime.now(UTC).isoformat(sep=" ", timespec="seconds"),
        "machine": f"{platform.platform()}, {n_workers()} processor cores used",
        "Python": platform.python_version(),
        **{package: version(package) for package in PACKAGES},
    }
    for figure in figures:
        with atomic_write(folder / f"{figure.name}.png") as path:
            path.write_bytes(figure.png)
    page = folder / PAGE_NAME
    with atomic_write(page) as path:
        path.write_text(_page(title, results, figures, facts, classes), encoding="utf-8")
    return page


def _page(
    title: str,
    results: Sequence[Result],
    figures: Iterable[Figure],
    facts: Mapping[str, object],
    classes: Classes | None,
) -> str:
    experiments = dict.fromkeys(result.experiment for result in results)
    cited = [f"<li>{escape(source)}</li>" for source in sources(results)]
    parts = [
        f"<h1>{escape(title)}</h1>",
        *(_experiment(name, [r for r in results if r.experiment == name], classes) for name in experiments),
        NOTE,
        *(["<p>Numbers by others, in italics:</p><ul>", *cited, "</ul>"] if cited else []),
        *map(_figure, figures),
        "<h2>How it was made</h2><dl>",
        *(f"<dt>{escape(name)}</dt><dd>{escape(str(value))}</dd>" for name, value in facts.items()),
        "</dl>",
    ]
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style>'
    viewport = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    body = "\n".join(parts)
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>{head}{viewport}</head>\n<body>\n{body}\n</body>\n</html>\n'


def _experiment(name: str, results: Sequence[Result], classes: Classes | None) -> str:
    more = {"Each scene": scene_table(results)}
    if classes is not None:
        more["IoU of each class"] = class_table(results, classes)
    return "\n".join(
        [
            f"<h2>Experiment: {escape(name)}</h2>",
            f'<div class="wide">{score_table(results)}</div>',
            *(
                f'<details><summary>{label}</summary><div class="wide">{made}</div></details>'
                for label, made in more.items()
            ),
        ]
    )


def _figure(figure: Figure) -> str:
    data = base64.b64encode(figure.png).decode("ascii")
    caption = escape(figure.caption)
    return (
        f"""<figure><img alt="" src="data:image/png;base64,{data}"><figcaption>{caption}</figcaption></figure>"""
    )
