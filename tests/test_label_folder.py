"""Label folders: what is written is read again, and what is damaged is refused."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgp.classes import Classes
from semgp.errors import FileFormatError, InputError
from semgp.readers.grids import enlarge, enlarged_argmax, sample
from semgp.readers.label_folder import LabelFolder, open_for_writing, write_labels

THREE = Classes(("floor", "wall", "chair"), ((1, 2, 3), (4, 5, 6), (7, 8, 9)))


def labels_and_probability() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    return rng.integers(-1, 3, (6, 8)), rng.dirichlet(np.ones(3), (2, 4))


def written(path: Path) -> LabelFolder:
    open_for_writing(path, THREE)
    labels, probability = labels_and_probability()
    write_labels(path, "a.color", labels, 3, probability, corners=True)
    return LabelFolder(path)


def test_there_and_back(tmp_path: Path) -> None:
    folder = written(tmp_path / "labels")
    labels, probability = labels_and_probability()
    assert folder.classes == THREE
    np.testing.assert_array_equal(folder.labels("a.color", (6, 8)), labels)
    found = folder.probability("a.color")
    assert found is not None
    np.testing.assert_allclose(found[0], probability, atol=0.5 / 255 + 1e-6)
    assert found[1] is True
    assert sorted(p.name for p in folder.path.iterdir()) == ["a.color.npz", "a.color.png", "classes.toml"]


def test_at_pixels(tmp_path: Path) -> None:
    folder = written(tmp_path)
    pixels = np.array([[0, 0], [5, 7], [3, 4]], np.int32)
    hard, none = folder.at_pixels("a.color", pixels, (6, 8), soft=False)
    assert none is None
    np.testing.assert_array_equal(hard, labels_and_probability()[0][[0, 5, 3], [0, 7, 4]])
    no_labels, soft = folder.at_pixels("a.color", pixels, (6, 8))
    assert no_labels is None
    assert soft is not None
    np.testing.assert_allclose(soft.sum(axis=1), 1, atol=3 / 255)
    (folder.path / "a.color.npz").unlink()
    hard, none = folder.at_pixels("a.color", pixels, (6, 8))
    assert none is None
    assert hard is not None


def test_more_classes_than_8_bits_hold(tmp_path: Path) -> None:
    classes = Classes.numbered(300)
    open_for_writing(tmp_path, classes)
    labels = np.arange(300).reshape(15, 20) - 1
    write_labels(tmp_path, "a", labels, 300)
    np.testing.assert_array_equal(LabelFolder(tmp_path).labels("a"), labels)


def test_raw_ids(tmp_path: Path) -> None:
    Image.fromarray(np.array([[7, 11], [0, 255]], np.uint8)).save(tmp_path / "a.png")
    classes = Classes(("floor", "wall"), ids=((11, 255), (7,)))
    np.testing.assert_array_equal(LabelFolder(tmp_path, classes).labels("a"), [[1, 0], [-1, 0]])


def test_folders_of_other_classes_are_not_written_to(tmp_path: Path) -> None:
    open_for_writing(tmp_path, THREE)
    open_for_writing(tmp_path, THREE)
    with pytest.raises(InputError, match="labels of other classes"):
        open_for_writing(tmp_path, Classes(("floor", "wall")))
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file"):
        open_for_writing(tmp_path / "file", THREE)


def test_probabilities_out_of_range(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="between 0 and 1"):
        write_labels(tmp_path, "a", np.zeros((2, 2), int), 1, np.full((2, 2, 1), 1.5))
    assert not list(tmp_path.iterdir())


def test_what_is_damaged_is_refused(tmp_path: Path) -> None:
    folder = written(tmp_path)
    with pytest.raises(FileFormatError, match=r"b\.png: no such file"):
        folder.labels("b")
    with pytest.raises(FileFormatError, match="are expected"):
        folder.labels("a.color", (6, 9))
    Image.fromarray(np.full((2, 2), 3, np.uint8)).save(tmp_path / "c.png")
    with pytest.raises(FileFormatError, match="labels up to 3, but there are 3 classes"):
        folder.labels("c")
    for arrays in (
        {"q": np.zeros(1)},
        {"p": np.zeros((2, 2, 4), np.uint8)},
        {"p": np.zeros((2, 2, 3))},
        {"p": np.zeros((2, 2, 3), np.uint8), "corners": np.zeros(2, bool)},
    ):
        np.savez(tmp_path / "c.npz", **arrays)
        with pytest.raises(FileFormatError, match=r"c\.npz"):
            folder.probability("c")
    with pytest.raises(InputError, match="no such folder"):
        LabelFolder(tmp_path / "nothing")
    (tmp_path / "classes.toml").unlink()
    with pytest.raises(FileFormatError, match=r"has no classes\.toml"):
        LabelFolder(tmp_path)


class TestGrids:
    def test_sample_is_enlarge_at_pixels(self) -> None:
        rng = np.random.default_rng(1)
        grid = rng.random((5, 7, 3))
        pixels = np.argwhere(np.ones((11, 30), bool))
        for corners in (False, True):
            fine = enlarge(grid, (11, 30), corners=corners)
            np.testing.assert_allclose(
                sample(grid, pixels, (11, 30), corners=corners), fine.reshape(-1, 3), atol=1e-6
            )
            np.testing.assert_array_equal(
                enlarged_argmax(grid, (11, 30), corners=corners), fine.reshape(11, 30, 3).argmax(axis=2)
            )

    def test_by_centres_as_pillow_does(self) -> None:
        grid = np.random.default_rng(2).random((4, 6)).astype(np.float32)
        pillow = np.asarray(Image.fromarray(grid).resize((18, 20), Image.Resampling.BILINEAR))
        np.testing.assert_allclose(enlarge(grid[..., None], (20, 18))[..., 0], pillow, atol=1e-6)

    def test_by_corners_every_kth_value_is_the_grids_own(self) -> None:
        grid = np.random.default_rng(3).random((4, 6, 2)).astype(np.float32)
        np.testing.assert_allclose(enlarge(grid, (12, 18), corners=True)[::3, ::3], grid, atol=1e-6)

    def test_a_grid_of_one_cell_and_one_of_the_images_size(self) -> None:
        one = np.array([[[0.25, 0.75]]])
        np.testing.assert_allclose(enlarge(one, (3, 2)), np.broadcast_to(one, (3, 2, 2)))
        grid = np.random.default_rng(4).random((3, 2, 2))
        for corners in (False, True):
            np.testing.assert_allclose(enlarge(grid, (3, 2), corners=corners), grid, atol=1e-6)
