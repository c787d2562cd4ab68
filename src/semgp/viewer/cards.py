"""The pieces of HTML in the live viewer's panel. Names are escaped: they come from files."""

from __future__ import annotations

import html

import numpy as np

from semgp.classes import MISSING
from semgp.picture.colour import GREY, by_value
from semgp.prediction import UNKNOWN
from semgp.viewer.fields import Scale
from semgp.viewer.state import Sample

STYLE = """<style>
.semgp { padding: 2px 14px 6px; font-size: 13px; font-variant-numeric: tabular-nums; }
.semgp .soft { opacity: .65; }
.semgp .swatch { width: 15px; height: 15px; border-radius: 4px; box-shadow: inset 0 0 0 1px #0003; }
.semgp .name { display: flex; gap: 8px; align-items: center; font-size: 15px; font-weight: 650; }
.semgp .ramp { height: 10px; border-radius: 3px; }
.semgp .ends { display: flex; justify-content: space-between; font-size: 12px; }
.semgp table { width: 100%; border-collapse: collapse; margin-top: 6px; }
.semgp th { font-weight: 400; text-align: right; }
.semgp td.of { max-width: 84px; overflow: hidden; text-overflow: ellipsis; white-space: nowrap; }
.semgp td.bar { width: 40%; }
.semgp td.bar div { height: 8px; border-radius: 3px; background: #8883; overflow: hidden; }
.semgp td.number { text-align: right; padding-left: 8px; white-space: nowrap; }
.semgp-row { position: relative; height: 0; }
.semgp-row .swatch { position: absolute; right: 14px; top: -26px; width: 15px; height: 15px; border-radius: 4px;
  box-shadow: inset 0 0 0 1px #0003; }
</style>"""
"""What the pieces look like: to be put into the panel once."""

_TOP = 8
"""Classes of a point in the table; the others are one row."""


def swatch(colour: tuple[int, int, int]) -> str:
    """Return a square of a colour, laid over the row of the panel above it."""
    return f'<div class="semgp-row"><div class="swatch" style="background:{_css(colour)}"></div></div>'


def colour_bar(scale: Scale | None, unit: str) -> str:
    """Return a bar of a field's colours with its ends; nothing for the classes' own colours."""
    if scale is None:
        return ""
    stops = by_value(np.linspace(0, 1, 12), 0, 1, scale.colour_map)
    ramp = ", ".join(_css(stop) for stop in stops.tolist())
    ends = f"<span>{scale.low:.3g}</span><span>{scale.high:.3g} {html.escape(unit)}</span>"
    return (
        f'<div class="semgp"><div class="ramp" style="background:linear-gradient(90deg, {ramp})"></div>'
        f'<div class="ends soft">{ends}</div></div>'
    )


def message(text: str) -> str:
    """Return a line of small text."""
    return f'<div class="semgp"><span class="soft">{html.escape(text)}</span></div>'


def answer(sample: Sample, row: int) -> str:
    """Return what the map says at a point of a sample: classes, highest first, place, variance, occupancy."""
    classes, label = sample.prediction.classes, int(sample.prediction.label[row])
    name, colour = ("not observed", GREY) if label == MISSING else (classes.names[label], classes.colours[label])
    place = " · ".join(f"{axis} {v:.2f}" for axis, v in zip("xyz", sample.points[row]))
    return (
        f'<div class="semgp"><div class="name"><div class="swatch" style="background:{_css(colour)}"></div>'
        f'{html.escape(name)}</div><div class="soft">{place} m<br>{_facts(sample, row)}</div>'
        f"{_table(sample, row)}</div>"
    )


def _facts(sample: Sample, row: int) -> str:
    facts, occupancy = [f"entropy {sample.prediction.entropy[row]:.3g}"], sample.prediction.occupancy
    if occupancy is not None:
        known = ", not known" if occupancy.state[row] == UNKNOWN else ""
        facts.append(f"occupancy {occupancy.probability[row]:.3g}{known}")
    return " · ".join(facts)


def _table(sample: Sample, row: int) -> str:
    probability, variance = sample.prediction.probability[row], sample.prediction.variance
    order = np.argsort(-probability, kind="stable")
    head = "" if variance is None else "<tr class='soft'><th colspan='3'></th><th>variance</th></tr>"
    lines = [
        _line(sample, int(c), float(probability[c]), "" if variance is None else f"{variance[row, c]:.3g}")
        for c in order[:_TOP]
    ]
    if len(order) > _TOP:
        share = 100 * float(probability[order[_TOP:]].sum())
        lines.append(
            f"<tr class='soft'><td colspan='2'>{len(order) - _TOP} others</td>"
            f"<td class='number'>{share:.1f} %</td></tr>"
        )
    return f"<table>{head}{''.join(lines)}</table>"


def _line(sample: Sample, c: int, probability: float, variance: str) -> str:
    classes = sample.prediction.classes
    name = html.escape(classes.names[c])
    fill = f"width:{100 * probability:.1f}%;background:{_css(classes.colours[c])}"
    return (
        f'<tr><td class="of" title="{name}">{name}</td><td class="bar"><div><div style="{fill}"></div></div></td>'
        f'<td class="number">{100 * probability:.1f} %</td><td class="number">{variance}</td></tr>'
    )


def _css(colour: tuple[int, int, int]) -> str:
    return f"rgb({', '.join(map(str, colour))})"
