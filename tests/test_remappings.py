"""The remappings that users name."""

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.class_files import REMAPPINGS, remapping
from semgp.classes import Classes
from semgp.conventions import ADE20K_32, ADE20K_32_TO_NYU13, NYU40, NYU40_TO_NYU13, relabel
from semgp.errors import InputError
from semgp.remapping import remapping_table


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
