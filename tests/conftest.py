"""Fixtures that all tests share."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the real data: $SEMGP_DATA, or shared/data beside the checkout; skips where it is absent."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("SEMGP_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"real data not found in {folder}; set SEMGP_DATA to its folder")
    return folder
