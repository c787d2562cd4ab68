"""Pictures that move."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgp.errors import InputError
from semgp.picture.animation import save_animation


class TestAnimation:
    frames = np.random.default_rng(0).integers(0, 256, (5, 24, 32, 3), dtype=np.uint8)

    @pytest.mark.parametrize("suffix", [".gif", ".webp", ".png"])
    def test_it_opens_again_with_all_its_frames(self, suffix: str, tmp_path: Path) -> None:
        path = tmp_path / f"turn{suffix}"
        save_animation(path, iter(self.frames), rate=10)
        with Image.open(path) as moving:
            assert getattr(moving, "n_frames", 1) == 5
            assert moving.size == (32, 24)
            moving.seek(3)
            moving.load()
            assert moving.info["duration"] == 100
            if suffix == ".png":
                np.testing.assert_array_equal(np.asarray(moving.convert("RGB")), self.frames[3])
        assert [f.name for f in tmp_path.iterdir()] == [path.name]

    def test_bad_input_leaves_nothing(self, tmp_path: Path) -> None:
        bad: list[tuple[str, Callable[[], None]]] = [
            ("ends in", lambda: save_animation(tmp_path / "a.mp4", self.frames)),
            ("two pictures", lambda: save_animation(tmp_path / "a.gif", self.frames[:1])),
            ("one size", lambda: save_animation(tmp_path / "a.gif", [self.frames[0], self.frames[0, :9]])),
            ("rate", lambda: save_animation(tmp_path / "a.gif", self.frames, rate=0)),
            ("uint8", lambda: save_animation(tmp_path / "a.gif", self.frames.astype(float))),
        ]
        for message, save in bad:
            with pytest.raises(InputError, match=message):
                save()
        assert not list(tmp_path.iterdir())
