"""What is in the self-contained page."""

import base64
import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.gp import GPSemanticMap
from semgp.viewer import page, write_page
from tests.viewer.maps import MODEL, built


def embedded(text: str) -> dict[str, Any]:
    match = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert match is not None
    data: dict[str, Any] = json.loads(match[1])
    return data


def columns(level: dict[str, Any]) -> dict[str, np.ndarray]:
    raw = zlib.decompress(base64.b64decode(level["data"]))
    return {
        name: np.frombuffer(raw, "<" + c["type"], level["points"] * c["width"], c["offset"]).reshape(
            level["points"], c["width"]
        )
        for name, c in level["columns"].items()
    }


HOSTILE = (
    "</script><script>alert(1)</script>",
    "<!--<img src=x onerror=alert(2)>",
    '{{data}} & "it\'s" ]]>\u2028',
)


@pytest.mark.parametrize("shift", [0.0, 5e6])
def test_what_is_embedded_is_what_the_map_says(corner: LabelledCloud, shift: float) -> None:
    gp_map = built(corner, shift=shift)
    data = embedded(page(gp_map, resolution=0.1))
    assert [level["resolution"] for level in data["levels"]] == pytest.approx([0.1, 0.2, 0.4])
    assert data["seeInside"]
    for level in data["levels"]:
        column = columns(level)
        points = np.array(level["low"]) + column["position"] / 65535 * np.array(level["extent"])
        prediction = gp_map.query(points)
        best = np.take_along_axis(prediction.probability, column["top"].astype(int), axis=1)
        np.testing.assert_allclose(column["p"] / 255, best, atol=0.006)
        np.testing.assert_array_equal(column["label"] == 3, (prediction.label == -1)[:, None])
        np.testing.assert_array_equal(np.diff(column["p"].astype(int), axis=1) <= 0, True)
        low, high = level["scales"]["variance"]
        assert prediction.variance is not None
        np.testing.assert_allclose(
            low + column["variance"][:, 0] / 255 * (high - low),
            np.where(prediction.observed, prediction.variance[:, 0], low),
            atol=0.01,
        )


def test_the_page_is_self_contained(corner: LabelledCloud) -> None:
    text = page(built(corner), title="A <room> & more")
    assert "<title>A &lt;room&gt; &amp; more</title>" in text
    assert not re.search(r"https?://|src=|@import|url\(", text)
    assert "default-src 'none'" in text


def test_hostile_names_stay_names(corner: LabelledCloud) -> None:
    text = page(built(corner, HOSTILE), title=HOSTILE[0])
    assert text.count("<script") == text.count("</script>") == 2
    assert "<img" not in text
    assert [c["name"] for c in embedded(text)["classes"]] == list(HOSTILE)


def test_the_size_is_bounded(corner: LabelledCloud, tmp_path: Path) -> None:
    gp_map = built(corner)
    size = write_page(gp_map, tmp_path / "map.html", most_bytes=140_000)
    assert size == (tmp_path / "map.html").stat().st_size <= 140_000
    with pytest.raises(InputError, match="does not fit its size"):
        page(gp_map, most_bytes=140_000, resolution=0.005)
    with pytest.raises(InputError, match="no room for points"):
        page(gp_map, most_bytes=1000)


def test_many_classes(corner: LabelledCloud) -> None:
    data = embedded(page(built(corner, tuple(f"c{i}" for i in range(300))), resolution=0.2))
    assert columns(data["levels"][0])["label"].max() in (2, 300)


def test_bad_input(corner: LabelledCloud, tmp_path: Path) -> None:
    gp_map = built(corner)
    with pytest.raises(InputError, match="map is empty"):
        page(GPSemanticMap(corner.classes, MODEL))
    with pytest.raises(InputError, match="no class is called 'sofa'"):
        page(gp_map, hide=["sofa"])
    with pytest.raises(InputError, match="no field 'depth'"):
        page(gp_map, field="depth")
    with pytest.raises(InputError, match="up is one of"):
        page(gp_map, up="w")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"ends in \.html"):
        write_page(gp_map, tmp_path / "map.txt")
    with pytest.raises(InputError, match="positive number of metres"):
        page(gp_map, resolution=float("nan"))
    assert not list(tmp_path.iterdir())
