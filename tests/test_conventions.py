"""Class lists and the tables between them."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgp.classes import MISSING, Classes
from semgp.conventions import (
    ADE20K_32,
    ADE20K_32_TO_NYU13,
    NYU13,
    NYU40,
    NYU40_TO_NYU13,
    SEMANTIC_KITTI,
    SEMANTIC_KITTI_IDS,
    labels_from_nyu,
    labels_from_semantic_kitti,
    relabel,
)
from semgp.errors import InputError

# The map as it is published with the 13 classes: entry k is the 1-based class of NYU40 class k + 1.
PUBLISHED_40_TO_13 = [
    *(12, 5, 6, 1, 4, 9, 10, 12, 13, 6, 8, 6, 13, 10, 6, 13, 6, 7, 7, 5),
    *(7, 3, 2, 6, 11, 7, 7, 7, 7, 7, 7, 6, 7, 7, 7, 7, 7, 7, 6, 7),
]


@pytest.mark.parametrize(
    ("classes", "n", "first", "last"),
    [
        (NYU13, 13, "bed", "window"),
        (NYU40, 40, "wall", "otherprop"),
        (ADE20K_32, 32, "other", "armchair"),
        (SEMANTIC_KITTI, 19, "car", "traffic-sign"),
    ],
)
def test_class_lists(classes: Classes, n: int, first: str, last: str) -> None:
    assert len(classes) == n
    assert (classes.names[0], classes.names[-1]) == (first, last)
    assert len(set(classes.colours)) == n


def test_colours_are_the_published_ones() -> None:
    assert SEMANTIC_KITTI.colours[SEMANTIC_KITTI.index("road")] == (255, 0, 255)
    assert SEMANTIC_KITTI.colours[SEMANTIC_KITTI.index("car")] == (100, 150, 245)
    assert NYU40.colours[NYU40.index("wall")] == (174, 199, 232)
    assert NYU13.colours[NYU13.index("books")] == (233, 89, 48)


def test_nyu40_to_nyu13_is_the_published_map() -> None:
    np.testing.assert_array_equal(NYU40_TO_NYU13 + 1, PUBLISHED_40_TO_13)


def test_nyu40_to_nyu13_agrees_with_the_label_images(data_dir: Path) -> None:
    for path in sorted((data_dir / "nyu").glob("*_label40.png")):
        label40 = labels_from_nyu(np.array(Image.open(path)), NYU40)
        label13 = np.array(Image.open(path.with_name(path.name.replace("label40", "label13"))))
        np.testing.assert_array_equal(relabel(label40, NYU40_TO_NYU13), labels_from_nyu(label13, NYU13))


def test_ade20k_to_nyu13_agrees_with_the_network_labels(data_dir: Path) -> None:
    for path in sorted((data_dir / "nyu").glob("*_mosaic_ade32.png")):
        ade32 = np.array(Image.open(path))
        nyu13 = np.array(Image.open(path.with_name(path.name.replace("ade32", "nyu13"))))
        np.testing.assert_array_equal(relabel(ade32, ADE20K_32_TO_NYU13), labels_from_nyu(nyu13, NYU13))


def test_ade20k_cannot_say_books_or_tv() -> None:
    never = set(range(13)) - set(ADE20K_32_TO_NYU13.tolist())
    assert {NYU13.names[c] for c in never} == {"books", "tv"}


def test_semantic_kitti_ids() -> None:
    raw = [10, 252, 40, 60, 44, 81, 259, 254, 0, 1, 52, 99, 65535]
    names = [
        SEMANTIC_KITTI.names[c] if c >= 0 else None for c in labels_from_semantic_kitti(np.array(raw)).tolist()
    ]
    assert names[:8] == ["car", "car", "road", "road", "parking", "traffic-sign", "other-vehicle", "person"]
    assert names[8:] == [None] * 5
    assert tuple(SEMANTIC_KITTI_IDS) == SEMANTIC_KITTI.names
    ids = [i for group in SEMANTIC_KITTI_IDS.values() for i in group]
    assert len(ids) == len(set(ids))


def test_semantic_kitti_instance_bits_are_ignored() -> None:
    instance = np.array([10 | 7 << 16, 0xFFFF << 16 | 40], dtype=np.uint32)
    np.testing.assert_array_equal(labels_from_semantic_kitti(instance), labels_from_semantic_kitti([10, 40]))


def test_relabel_keeps_missing_and_shape() -> None:
    labels = np.array([[0, MISSING], [1, 2]])
    table = np.array([5, MISSING, 7], dtype=np.int32)
    np.testing.assert_array_equal(relabel(labels, table), [[5, MISSING], [MISSING, 7]])


def test_relabel_of_nothing() -> None:
    assert relabel(np.empty(0, dtype=int), NYU40_TO_NYU13).shape == (0,)


@pytest.mark.parametrize("bad", [[40], [-2], [0.5]])
def test_relabel_refuses(bad: list[float]) -> None:
    with pytest.raises(InputError, match="labels"):
        relabel(bad, NYU40_TO_NYU13)


def test_nyu_ids_above_the_classes_are_refused() -> None:
    np.testing.assert_array_equal(labels_from_nyu([0, 1, 13], NYU13), [MISSING, 0, 12])
    with pytest.raises(InputError, match="between 0 and 13"):
        labels_from_nyu([14], NYU13)
