"""Class files in their three formats, and the lists known by name."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgp.class_files import ClassFile, class_list, read_class_file, write_class_file
from semgp.classes import MISSING, Classes
from semgp.conventions import CLASS_LISTS, NYU13, NYU40, SEMANTIC_KITTI, SEMANTIC_KITTI_IDS
from semgp.errors import InputError, MissingExtraError
from tests.class_file_texts import CSV, TOML, YAML, written


def test_toml(tmp_path: Path) -> None:
    content = read_class_file(written(tmp_path, "classes.toml", TOML))
    assert content.classes.names == ("seat", "floor mat")
    assert content.classes.colours[0] == (0x95, 0, 0xF0)
    assert content.classes.ids == ((5, 6), ())
    assert content.members == (("armchair", "sofa"), ())


def test_csv(tmp_path: Path) -> None:
    content = read_class_file(written(tmp_path, "classes.csv", CSV))
    assert content.classes.names == ("seat", "floor mat")
    assert content.classes.ids == ((5, 6), (1,))  # an empty cell says nothing: the label itself
    assert content.members == (("armchair", "sofa"), ())
    assert read_class_file(written(tmp_path, "a.csv", "name\nroad\ncar\n")).classes == Classes(("road", "car"))


def test_yaml(tmp_path: Path) -> None:
    pytest.importorskip("yaml")
    content = read_class_file(written(tmp_path, "kitti.yaml", YAML))
    assert content.classes == Classes(("car", "road"), ((100, 150, 245), (255, 0, 255)))
    assert content.classes.ids == ((10, 252), (40, 60))
    assert content.members == (("car", "moving-car"), ("road", "lane-marking"))


def test_yaml_without_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "yaml", None)
    with pytest.raises(MissingExtraError, match=r"semgp\[yaml\]"):
        read_class_file(written(tmp_path, "kitti.yaml", YAML))


name = st.text(st.characters(exclude_categories=("C", "Z"), exclude_characters=";"), min_size=1, max_size=8)


@given(
    data=st.data(),
    names=st.lists(name, min_size=1, max_size=5, unique=True),
    ending=st.sampled_from(["toml", "csv"]),
)
def test_what_is_written_is_read_again(
    data: st.DataObject, names: list[str], ending: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    n = len(names)
    colours = tuple(data.draw(st.tuples(*[st.integers(0, 255)] * 3)) for _ in names)
    ids = data.draw(st.lists(st.integers(0, 2**32 - 1), min_size=n, max_size=n, unique=True))
    members = data.draw(st.lists(name, min_size=n, max_size=n, unique=True))
    content = ClassFile(Classes(tuple(names), colours, tuple((i,) for i in ids)), tuple((m,) for m in members))
    path = tmp_path_factory.getbasetemp() / f"classes.{ending}"
    write_class_file(path, content)
    again = read_class_file(path)
    assert again == content
    assert again.classes.ids == content.classes.ids


def test_plain_classes_are_written_without_ids(tmp_path: Path) -> None:
    write_class_file(tmp_path / "classes.toml", CLASS_LISTS["nyu13"])
    assert "ids" not in (tmp_path / "classes.toml").read_text()
    again = read_class_file(tmp_path / "classes.toml").classes
    assert again == NYU13
    assert again.ids == ()


def test_files_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.toml or \.csv"):
        write_class_file(tmp_path / "classes.yaml", NYU13)
    with pytest.raises(InputError, match="no ids"):
        write_class_file(tmp_path / "classes.csv", ClassFile(Classes(("a", "b"), ids=((1,), ()))))
    assert list(tmp_path.iterdir()) == []


def test_lists_by_name(tmp_path: Path) -> None:
    assert class_list("nyu13") == NYU13
    assert class_list("NYU40").ids[0] == (1,)
    assert class_list("3") == Classes.numbered(3)
    assert len(class_list("ade20k")) == 150
    assert class_list(str(written(tmp_path, "a.toml", TOML))).names == ("seat", "floor mat")
    for wrong in ("kitti", "0", "1001", "-3", "classes"):
        with pytest.raises(InputError, match="nyu13, nyu40, scannet, semantickitti, ade20k"):
            class_list(wrong)


def test_scannet_is_the_benchmarks() -> None:
    scannet = CLASS_LISTS["scannet"]
    assert [i for (i,) in scannet.ids] == [*range(1, 13), 14, 16, 24, 28, 33, 34, 36, 39]
    assert scannet.names[17] == "sink"
    assert scannet.colours[3] == NYU40.colours[NYU40.index("bed")]


@pytest.mark.parametrize("name", sorted(CLASS_LISTS))
def test_ids_become_labels(name: str) -> None:
    classes = CLASS_LISTS[name]
    ids = classes.ids or tuple((c,) for c in range(len(classes)))
    for label, of_class in enumerate(ids):
        np.testing.assert_array_equal(classes.from_ids(np.array(of_class)), label)


@given(st.lists(st.integers(-1, 300), max_size=20))
def test_ids_against_a_loop(raw: list[int]) -> None:
    kinds = {i: SEMANTIC_KITTI.index(name) for name, ids in SEMANTIC_KITTI_IDS.items() for i in ids}
    labels = CLASS_LISTS["semantickitti"].from_ids(np.array(raw, dtype=np.int32))
    assert labels.tolist() == [kinds.get(i, MISSING) for i in raw]
