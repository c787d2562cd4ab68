"""Class files that are wrong, hostile or damaged."""

from pathlib import Path

import numpy as np
import pytest

from semgp.class_files import read_class_file
from semgp.errors import FileFormatError, InputError
from tests.class_file_texts import CSV, TOML, YAML, written


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
