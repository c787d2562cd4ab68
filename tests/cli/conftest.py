"""What tests of commands share."""

from pathlib import Path

import pytest

from semgp.cloud import LabelledCloud
from semgp.writers import write_npz


@pytest.fixture
def scan(corner: LabelledCloud, tmp_path: Path) -> Path:
    write_npz(tmp_path / "scan.npz", corner)
    return tmp_path / "scan.npz"
