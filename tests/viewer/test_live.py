"""The live viewer: a real server."""

import contextlib
import socket
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import InputError, MissingExtraError
from semgp.maps.gp import GPSemanticMap
from semgp.octomap import SemanticOctoMap
from semgp.viewer.layers import cloud_layer, octomap_layer
from semgp.viewer.live import LiveViewer
from semgp.viewer.playback import Playback
from tests.viewer.conftest import MODEL

pytest.importorskip("viser", reason="the live viewer needs the extra view")


def test_choices_change_what_is_seen(viewer: LiveViewer, capsys: pytest.CaptureFixture[str]) -> None:
    assert viewer.url.startswith("http://127.0.0.1:")
    first = viewer.shown
    assert first is not None
    viewer.change(field="entropy")
    assert viewer.wait(60)
    assert viewer.shown is not None
    assert viewer.shown.sample is first.sample  # not asked anew
    assert viewer.shown.scale is not None
    viewer.switch(0, on=False)
    assert viewer.wait(60)
    assert len(viewer.shown.rows) < len(first.rows)
    viewer.change(resolution=first.sample.resolution / 2)
    assert viewer.wait(60)
    assert len(viewer.shown.sample.points) > 2 * len(first.sample.points)
    assert capsys.readouterr().out == ""


def test_a_section_cuts_and_says_where(viewer: LiveViewer) -> None:
    z: Any = viewer._controls._section[2]
    assert "nothing is cut away" in viewer._controls._left.content
    z.value = (z.min, 0.5)
    viewer._controls._cut()
    assert viewer.wait(60)
    assert viewer.shown is not None
    assert 0 < len(viewer.shown.rows) < len(viewer.shown.sample.points)
    assert viewer.shown.points[:, 2].max() <= 0.5
    assert "to 0.50 m" in viewer._controls._left.content


def test_a_burst_of_requests_ends_with_the_last(viewer: LiveViewer) -> None:
    for resolution in np.linspace(0.3, 0.05, 20):
        viewer.change(resolution=float(resolution))
    assert viewer.wait(60)
    assert viewer.shown is not None
    assert viewer.shown.sample.resolution == pytest.approx(0.05)


def test_reading_a_point(viewer: LiveViewer, gp_map: GPSemanticMap) -> None:
    row = viewer.read((1.0, -1.0, 1.2), (0.0, 1.0, -0.7))
    assert row is not None
    assert viewer.shown is not None
    point = viewer.shown.sample.points[row]
    told = viewer._controls._answer.content
    assert f"{100 * gp_map.query([point]).probability.max():.1f} %" in told
    assert viewer.read((1.0, -1.0, 1.2), (0.0, -1.0, 0.0)) is None


def test_no_more_points_than_allowed(gp_map: GPSemanticMap) -> None:
    with LiveViewer(gp_map, port=0, most=50, resolution=0.01) as viewer:
        assert viewer.wait(60)
        assert viewer.shown is not None
        assert len(viewer.shown.sample.points) <= 50
        assert "no room for 1.0 cm" in viewer._controls.status.content


def test_layers_are_drawn(corner: LabelledCloud, gp_map: GPSemanticMap) -> None:
    octomap = SemanticOctoMap(corner.classes, 0.1)
    octomap.update(corner)
    layers = [cloud_layer([corner], 0.02, 1000), octomap_layer(octomap)]
    with LiveViewer(gp_map, port=0, layers=layers) as viewer:
        assert viewer.wait(60)
        handle = viewer._server.scene.get_handle_by_name("/layer-1")
        assert handle is not None
        assert not handle.visible
        viewer.switch_layer(layers[1].name, True)
        assert viewer.wait(60)
        handle = viewer._server.scene.get_handle_by_name("/layer-1")
        assert handle is not None
        assert handle.visible


def test_playback(corner: LabelledCloud) -> None:
    unlabelled = replace(corner, labels=None)
    scans = [unlabelled, corner[::2], corner[1::2]]
    with LiveViewer(Playback(scans, lambda: GPSemanticMap(corner.classes, MODEL)), port=0) as viewer:
        assert viewer.state.scans == 2
        assert viewer.wait(60)
        assert viewer.shown is not None
        before = len(viewer.shown.sample.points)
        viewer.change(scans=3)
        assert viewer.wait(60)
        assert len(viewer.shown.sample.points) > before
    with pytest.raises(InputError, match="no scan has a label"):
        LiveViewer(Playback([unlabelled], lambda: GPSemanticMap(corner.classes, MODEL)), port=0)


def test_bad_input(corner: LabelledCloud, gp_map: GPSemanticMap) -> None:
    with pytest.raises(InputError, match="map is empty"):
        LiveViewer(GPSemanticMap(corner.classes, MODEL))
    bad: list[tuple[dict[str, Any], str]] = [
        ({"field": "depth"}, "no field 'depth'"),
        ({"hide": ["sofa"]}, "no class is called 'sofa'"),
        ({"up": "w"}, "up is one of"),
        ({"resolution": -1.0}, "resolution"),
        ({"most": 0}, "at least one point"),
        ({"port": 70000}, "cannot listen"),
        ({"host": "256.1.1.1"}, "cannot listen"),
    ]
    for settings, message in bad:
        with pytest.raises(InputError, match=message):
            LiveViewer(gp_map, **settings)


def test_a_port_in_use(gp_map: GPSemanticMap) -> None:
    with contextlib.closing(socket.socket()) as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(InputError, match=r"cannot listen at 127\.0\.0\.1:\d+: .*Give another --port"):
            LiveViewer(gp_map, port=taken.getsockname()[1])


def test_a_missing_extra(gp_map: GPSemanticMap, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingExtraError, match=r"semgp\[view\]"):
        LiveViewer(gp_map, port=0)
