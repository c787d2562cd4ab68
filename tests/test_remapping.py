"""Turning one list of classes into another, by files and by the remappings that users name."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.class_files import REMAPPINGS, ClassFile, remapping
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.conventions import ADE20K_32, ADE20K_32_TO_NYU13, NYU13, NYU40, NYU40_TO_NYU13, relabel
from semgp.errors import InputError
from semgp.remapping import remapped, remapping_table, without_counterpart

OLD = Classes(("armchair", "sofa", "lamp", "floor", "rug"))
MAPPING = ClassFile(Classes(("floor", "seat", "rug")), (("rug",), ("armchair", "sofa"), ()))


def test_remapping_table() -> None:
    # the floor stays by its own name; the rug goes where it is listed, not to its own name
    assert remapping_table(OLD, MAPPING).tolist() == [1, 1, MISSING, 0, 0]
    assert remapping_table(NYU13, ClassFile(NYU13)).tolist() == list(range(13))


@given(st.integers(0, 2**32 - 1))
def test_soft_labels_against_a_loop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    weights = rng.random((6, 5)).astype(np.float32)
    weights[0] = [0, 0, 1, 0, 0]
    cloud = remapped(LabelledCloud(rng.normal(size=(6, 3)), OLD, weights=weights), MAPPING)
    expected = np.zeros((6, 3))
    for n, row in enumerate(weights.tolist()):
        for old, new in enumerate((1, 1, None, 0, 0)):
            if new is not None:
                expected[n, new] += row[old]
    assert cloud.weights is not None
    np.testing.assert_allclose(cloud.weights, expected, rtol=1e-6)
    assert cloud.labelled.tolist() == [False, *[True] * 5]
    assert cloud.classes == MAPPING.classes


def test_hard_labels_and_what_is_lost() -> None:
    labels = np.array([0, 1, 2, 3, 4, MISSING, 2])
    cloud = LabelledCloud(np.zeros((7, 3)), OLD, labels)
    assert remapped(cloud, MAPPING).hard_labels.tolist() == [1, 1, MISSING, 0, 0, MISSING, MISSING]
    assert without_counterpart(cloud, MAPPING) == {"lamp": 2}
    bare = LabelledCloud(np.zeros((7, 3)), OLD)
    assert remapped(bare, MAPPING).labels is None
    assert without_counterpart(bare, MAPPING) == {}


def test_numbers_without_names_are_taken_by_the_ids() -> None:
    mapping = ClassFile(Classes(("ground", "thing"), ids=((3, 1), (0,))))
    assert remapping_table(Classes.numbered(5), mapping).tolist() == [1, 0, MISSING, 0, MISSING]


def test_a_mapping_for_other_classes_is_refused() -> None:
    with pytest.raises(InputError, match=r"takes in none of the classes armchair"):
        remapping_table(OLD, ClassFile(Classes(("car", "road"))))


@pytest.mark.parametrize(
    ("name", "source", "table"),
    [("ade20k-32-to-nyu13", ADE20K_32, ADE20K_32_TO_NYU13), ("NYU40-to-NYU13", NYU40, NYU40_TO_NYU13)],
)
def test_they_are_the_tables(name: str, source: Classes, table: NDArray[np.int32]) -> None:
    labels = np.arange(len(source))
    np.testing.assert_array_equal(remapping_table(source, remapping(name))[labels], relabel(labels, table))


def test_an_unknown_one_is_refused_with_those_there_are() -> None:
    with pytest.raises(InputError, match="ade20k-32-to-nyu13, nyu40-to-nyu13"):
        remapping("nyu14")
    assert len(REMAPPINGS) == 2
