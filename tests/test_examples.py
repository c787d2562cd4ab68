"""Every example runs as it stands and makes its picture."""

import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_it_makes_its_picture(example: Path, tmp_path: Path) -> None:
    out = tmp_path / "picture.png"
    subprocess.run([sys.executable, example, "--out", out], check=True, cwd=tmp_path)
    with Image.open(out) as picture:
        assert min(picture.size) > 500
