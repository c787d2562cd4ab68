"""Class files in their three formats, the lists known by name, and turning one list into another."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgp.class_files import ClassFile, class_list, read_class_file, write_class_file
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.conventions import CLASS_LISTS, NYU13, NYU40, SEMANTIC_KITTI, SEMANTIC_KITTI_IDS
from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.remapping import remapped, remapping_table, without_counterpart

TOML = """
[[class]]
name = "seat"
colour = "#9500F0"
ids = [5, 6]
from = ["armchair", "sofa"]

[[class]]
name = "floor mat"
ids = []
"""

CSV = "name, colour, ids, from\nseat, #9500f0, 5 6, armchair; sofa\nfloor mat,,,\n"

YAML = """
labels:
  0: "unlabeled"
  1: "outlier"
  10: "car"
  40: "road"
  60: "lane-marking"
  252: "moving-car"
color_map: # bgr
  0: [0, 0, 0]
  10: [245, 150, 100]
  40: [255, 0, 255]
learning_map:
  0: 0
  1: 0
  10: 1
  252: 1
  40: 2
  60: 2
learning_map_inv:
  0: 0
  1: 10
  2: 40
learning_ignore:
  0: True
  1: False
  2: False
"""


def written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


# ---------------------------------------------------------------- reading and writing


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


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.toml", "", "no tables"),
        ("a.toml", "class = 3", "no tables"),
        ("a.toml", "[[class]\n", "is no TOML.*line 1"),
        ("a.toml", "[[class]]\ncolour = '#123456'\n", "class 0: a class needs a name"),
        ("a.toml", "[[class]]\nname = 'a'\n[[class]]\nname = 3\n", "class 1: name must be a text"),
        ("a.toml", "[[class]]\nname = 'a'\ncolor = '#123456'\n", "class 0: has no key 'color'"),
        ("a.toml", "[[class]]\nname = 'a'\ncolour = 'red'\n", "class 0: a colour is written #rrggbb"),
        ("a.toml", "[[class]]\nname = 'a'\nids = 3\n", "class 0: ids must be a list"),
        ("a.toml", "[[class]]\nname = 'a'\nids = [true]\n", "class 0: ids must be a list"),
        ("a.toml", "[[class]]\nname = 'a'\nids = [-1]\n", "class 0: ids are whole numbers"),
        ("a.toml", "[[class]]\nname = 'a'\nfrom = 'b'\n", "class 0: from must be a list"),
        ("a.toml", "[[class]]\nname = 'a'\n[[class]]\nname = 'a'\n", "more than once"),
        ("a.toml", "[[class]]\nname = 'a'\nids = [1, 1]\n", "raw id 1"),
        ("a.toml", "[[class]]\nname = 'a'\nfrom = ['x']\n[[class]]\nname = 'b'\nfrom = ['x']\n", "'x' becomes"),
        ("a.toml", "a = " + "[" * 5000, "is no TOML"),
        ("a.toml", "#" * (1 << 20) + "#", "more than"),
        ("a.csv", "", "line 1: the columns"),
        ("a.csv", "label,colour\nroad,#123456\n", "line 1: the columns"),
        ("a.csv", "name,name\nroad,car\n", "line 1: the columns"),
        ("a.csv", "name,ids\nroad,1\ncar\n", "line 3: has more or fewer cells"),
        ("a.csv", "name\nroad,1\n", "line 2: has more or fewer cells"),
        ("a.csv", "name,ids\nroad,x\n", "line 2: ids are whole numbers"),
        ("a.csv", "name,ids\nroad,99999999999\n", "line 2: ids are whole numbers"),
        ("a.csv", "name\n \n", "needs a name"),
        ("a.csv", "name\n", "at least one name"),
        ("a.csv", 'name\n"road\n', "is no csv"),
        ("a.yaml", "{", "is no yaml"),
        ("a.yaml", "- 1", "needs labels, learning_map"),
        ("a.yaml", "a: &a [1]\nb: *a", "aliases"),
        ("a.yaml", "[" * 100_000, "too deep"),
        ("a.yaml", YAML.replace('40: "road"', "40: 7"), "labels: 40 must be a name"),
        ("a.yaml", YAML.replace('40: "road"', ""), "learning_map_inv: class 2"),
        ("a.yaml", YAML.replace("  10: 1\n  252", "  10: x\n  252"), "learning_map: 10 must be a whole"),
        ("a.yaml", YAML.replace("[245, 150, 100]", "[245, 150]"), "color_map: 10 must be three"),
        ("a.yaml", YAML.replace("  1: 10\n", "  one: 10\n"), "learning_map_inv: its keys"),
    ],
)  # fmt: skip
def test_hostile_files_are_refused(name: str, text: str, message: str, tmp_path: Path) -> None:
    path = written(tmp_path, name, text)
    with pytest.raises(FileFormatError, match=message) as caught:
        read_class_file(path)
    assert str(path) in str(caught.value)


def test_files_that_are_none(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(FileFormatError, match="UTF-8"):
        read_class_file(tmp_path / "a.toml")
    with pytest.raises(FileFormatError, match="cannot be read"):
        read_class_file(tmp_path / "b.toml")
    with pytest.raises(InputError, match="a class file ends in"):
        read_class_file(tmp_path / "c.txt")


@pytest.mark.parametrize(("name", "text"), [("a.toml", TOML), ("a.csv", CSV), ("a.yaml", YAML)])
def test_flipped_bytes_are_refused_or_make_classes(name: str, text: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    path, refusals = tmp_path / name, []
    for _ in range(150):
        raw = np.frombuffer(text.encode(), np.uint8).copy()
        raw[rng.integers(0, len(raw), 2)] = rng.integers(0, 256, 2)
        path.write_bytes(raw.tobytes()[: rng.integers(1, len(raw) + 1)])
        try:
            assert len(read_class_file(path).classes)
        except FileFormatError as error:
            refusals.append(str(error))
    assert len(refusals) > 5
    assert all(str(path) in refusal for refusal in refusals)


# ---------------------------------------------------------------- lists by name


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


# ---------------------------------------------------------------- remapping

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
