"""Killed writers; `benchmarks/store_crashes.py` kills hundreds, here are some."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "store_crashes.py"
KILLS = int(os.environ.get("SEMGP_KILLS", "24"))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_maps_survive_writers_that_are_killed_at_any_moment() -> None:
    command = [sys.executable, str(BENCHMARK), "--kills", str(KILLS), "--seed", "1", "--json"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    outcome = json.loads(ended.stdout)
    assert sum(writer["kills"] for writer in outcome.values()) == KILLS
    for writer in outcome.values():
        assert writer["left_partial"] + writer["left_orphans"] > 0  # some were killed at work
