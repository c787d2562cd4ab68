"""Class files in their three formats."""

from pathlib import Path

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
