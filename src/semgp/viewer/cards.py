"""The pieces of HTML in the live viewer's panel. Names are escaped: they come from files."""

from __future__ import annotations

import html

import numpy as np

from semgp.classes import MISSING
from semgp.picture.colour import GREY, by_value
from semgp.prediction import UNKNOWN
from semgp.viewer.fields import Scale
from semgp.viewer.sample import Sample

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
.semgp-row div { position: absolute; right: 14px; top: -25px; display: flex; gap: 9px; align-items: center;
  font-size: 12px; line-height: 15px; font-variant-numeric: tabular-nums; pointer-events: none; }
.semgp-row i { width: 15px; height: 15px; border-radius: 4px; box-shadow: inset 0 0 0 1px #0003; }
.semgp-row span { opacity: .65; }
</style>"""
"""What the pieces look like: to be put into the panel once."""

_TOP = 8
"""Classes of a point in the table, at most; the others are one row."""
_LEAST = 0.0005
"""Probability below which a class is one of the others."""


def swatch(colour: tuple[int, int, int], share: float) -> str:
    """Return a share and a square of a colour, laid over the row of the panel above it."""
    square = f'<i style="background:{_css(colour)}"></i>'
    return f'<div class="semgp-row"><div><span>{percent(share)}</span>{square}</div></div>'


def percent(share: float) -> str:
    """Return a share in words: "37 %", "0.8 %", "< 0.1 %"."""
    if 0 < share < 0.0005:
        return "&lt; 0.1 %"
    return f"{100 * share:.0f} %" if share >= 0.0995 else f"{100 * share:.1f} %"


def length(metres: float) -> str:
    """Return a distance between points in words: "25 cm", "1.1 cm", "1.20 m"."""
    if metres >= 1:
        return f"{metres:.2f} m"
    return f"{100 * metres:.0f} cm" if metres >= 0.1 else f"{100 * metres:.1f} cm"


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


def told(sample: Sample, seen: int, wanted: float) -> str:
    """Return how many points of a sample are seen, how far apart, and that more do not fit if so."""
    kept = length(sample.resolution)
    coarser = "" if kept == length(wanted) else f"; there is no room for {length(wanted)}"
    return f"{seen:,} of {len(sample.points):,} points, one every {kept}{coarser}"


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
    facts, occupancy = [f"entropy {sample.prediction.entropy[row]:.3g} nats"], sample.prediction.occupancy
    variance = sample.prediction.variance
    if variance is not None and not _variance_differs(sample, row):
        facts.append(f"variance {variance[row, 0]:.3g}")
    if occupancy is not None:
        known = ", not known" if occupancy.state[row] == UNKNOWN else ""
        facts.append(f"occupancy {occupancy.probability[row]:.3g}{known}")
    return " · ".join(facts)


def _table(sample: Sample, row: int) -> str:
    probability, variance = sample.prediction.probability[row], sample.prediction.variance
    order = np.argsort(-probability, kind="stable")
    listed = min(_TOP, max(1, int(np.count_nonzero(probability >= _LEAST))))
    own = _variance_differs(sample, row)
    head = "<tr class='soft'><th colspan='3'></th><th>variance</th></tr>" if own else ""
    lines = [
        _line(
            sample,
            int(c),
            float(probability[c]),
            f"{variance[row, c]:.3g}" if own and variance is not None else "",
        )
        for c in order[:listed]
    ]
    if len(order) > listed:
        share = 100 * float(probability[order[listed:]].sum())
        others = "1 other" if len(order) == listed + 1 else f"{len(order) - listed} others"
        lines.append(f"<tr class='soft'><td colspan='2'>{others}</td><td class='number'>{share:.1f} %</td></tr>")
    return f"<table>{head}{''.join(lines)}</table>"


def _variance_differs(sample: Sample, row: int) -> bool:
    """Whether the classes have variances of their own at a point."""
    variance = sample.prediction.variance
    return variance is not None and bool(np.ptp(variance[row]) > 1e-3 * np.abs(variance[row]).max())


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
