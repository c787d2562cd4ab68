"""Pictures in files."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgp.errors import InputError
from semgp.picture import (
    save_png,
)


def test_a_saved_picture_reads_back_the_same(tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    save_png(tmp_path / "a.png", image)
    save_png(str(tmp_path / "a.png"), image[::-1])  # replaces
    with Image.open(tmp_path / "a.png") as saved:
        assert saved.format == "PNG"
        np.testing.assert_array_equal(np.asarray(saved), image[::-1])
    assert [f.name for f in tmp_path.iterdir()] == ["a.png"]


def test_what_is_no_picture_is_not_saved(tmp_path: Path) -> None:
    image = np.zeros((20, 30, 3), dtype=np.uint8)
    for bad in (image.astype(float), image[..., 0], image[:0]):
        with pytest.raises(InputError, match="picture"):
            save_png(tmp_path / "a.png", bad)
    with pytest.raises(InputError, match="png"):
        save_png(tmp_path / "a.jpg", image)
    with pytest.raises(InputError, match="folder"):
        save_png(tmp_path / "none" / "a.png", image)
    assert not list(tmp_path.iterdir())
