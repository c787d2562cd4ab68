"""What people and machines look at: pages, and metrics."""

import sys
from pathlib import Path

from semgp.service.metrics import Metrics
from tests.service.requests import (
    HTTP,
    asked,
    npy,
    post,
)
from tests.service.running import running


def test_pages_load_nothing_from_elsewhere(store: Path) -> None:
    with running(store) as (url, _):
        docs = HTTP.get(url + "/docs")
        assert "POST /query" in docs.text
        assert "default-src 'none'" in docs.headers["Content-Security-Policy"]
        assert "in the making" in HTTP.get(url + "/").text
        while "X-Semgp-Version" not in (page := HTTP.get(url + "/")).headers:
            pass
        assert "<canvas" in page.text
        assert len(page.content) < 4_000_000
        for text in (docs.text, page.text):
            assert not any(f'{start}="http' in text for start in ("src", "href"))
        schema = HTTP.get(url + "/openapi.json").json()
        assert set(schema["paths"]) == {"/query", "/update", "/info", "/healthz", "/readyz", "/metrics"}


def test_metrics_are_prometheus_text(url: str) -> None:
    post(url, npy(asked()))
    text = HTTP.get(url + "/metrics").text
    assert 'semgp_requests_total{path="/query",status="200"}' in text
    samples = [line for line in text.splitlines() if not line.startswith("#")]
    assert all(float(line.rsplit(" ", 1)[1]) >= 0 for line in samples)
    assert any(line.startswith("process_resident_memory_bytes") for line in samples) or sys.platform != "linux"


def test_histograms_are_cumulative_and_labels_escaped() -> None:
    metrics = Metrics()
    for seconds in (0.001, 0.02, 99):
        metrics.time("semgp_request_seconds", seconds, path='a"b\\c\n')
    lines = metrics.text({}).splitlines()
    assert r'semgp_request_seconds_bucket{path="a\"b\\c\n",le="0.025"} 2' in lines
    assert r'semgp_request_seconds_bucket{path="a\"b\\c\n",le="+Inf"} 3' in lines
    assert r'semgp_request_seconds_sum{path="a\"b\\c\n"} 99.021' in lines
