"""The classes of a map: their names, in order, and their colours."""

from __future__ import annotations

import colorsys
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import chain
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError

T = TypeVar("T")

MISSING = -1
"""The hard label of a point whose class is not known."""


@dataclass(frozen=True)
class Classes:
    """Names and colours of C classes; class c is the c-th name, the label of a point is c.

    Parameters
    ----------
    names : tuple of str
        One name a class, all different.
    colours : tuple of (red, green, blue), optional
        One 8-bit colour a class. Left out, colours well apart in hue are chosen by position.
    ids : tuple of tuples of int, optional
        The raw ids by which files of some data set mean each class; all other ids are missing labels. Left out,
        files hold the labels themselves. Readers ask for it, by `from_ids`; maps and clouds do not.

    Raises
    ------
    InputError
        No names, a name that occurs twice, colours or ids that do not fit the names, or an id of two classes.
    """

    names: tuple[str, ...]
    colours: tuple[tuple[int, int, int], ...] = ()
    ids: tuple[tuple[int, ...], ...] = field(default=(), compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(str(name) for name in self.names))
        if not self.names:
            raise InputError("Classes needs at least one name.")
        if twice := sorted(repeated(self.names)):
            raise InputError(f"class names must differ, but {', '.join(twice)} occurs more than once.")
        colours = self.colours or tuple(_spread_colour(i) for i in range(len(self.names)))
        if len(colours) != len(self.names):
            raise InputError(f"{len(self.names)} class names but {len(colours)} colours: give one colour a class.")
        if any(len(colour) != 3 or not all(0 <= v <= 255 for v in colour) for colour in colours):
            raise InputError("a class colour is three whole numbers from 0 to 255: red, green, blue.")
        object.__setattr__(self, "colours", tuple((int(r), int(g), int(b)) for r, g, b in colours))
        if self.ids and len(self.ids) != len(self.names):
            raise InputError(
                f"{len(self.names)} class names but ids for {len(self.ids)}: give each class its ids."
            )
        if shared := sorted(repeated(chain.from_iterable(self.ids))):
            raise InputError(f"the raw id {shared[0]} belongs to more than one class.")

    @classmethod
    def numbered(cls, n_classes: int) -> Classes:
        """Classes called "class 0", "class 1" ..., for data that name none."""
        return cls(tuple(f"class {c}" for c in range(n_classes)))

    def __len__(self) -> int:
        return len(self.names)

    def index(self, name: str) -> int:
        """Return the label of the class called `name`.

        Raises
        ------
        InputError
            No class has that name.
        """
        if name not in self.names:
            raise InputError(f"no class is called {name!r}; the classes are {', '.join(self.names)}.")
        return self.names.index(name)

    @property
    def nameless(self) -> bool:
        """Whether the classes have numbers for names, as those of files that name none."""
        return self.names == tuple(f"class {c}" for c in range(len(self)))

    def from_ids(self, ids: NDArray[np.integer]) -> NDArray[np.int64]:
        """Return the labels that raw ids of any shape mean, `MISSING` for those of no class."""
        raw = ids.astype(np.int64)
        if not self.ids:
            return raw
        known = np.array([i for of_class in self.ids for i in of_class], dtype=np.int64)
        labels = np.repeat(np.arange(len(self)), [len(of_class) for of_class in self.ids])
        order = np.argsort(known)
        known, labels = np.append(known[order], np.iinfo(np.int64).max), np.append(labels[order], MISSING)
        at = np.searchsorted(known[:-1], raw)
        return np.where(known[at] == raw, labels[at], MISSING)

    @property
    def palette(self) -> NDArray[np.uint8]:
        """Colours as an array, shape (C, 3)."""
        return np.array(self.colours, dtype=np.uint8)


def repeated(items: Iterable[T]) -> set[T]:
    """Return the items that occur more than once."""
    return {item for item, n in Counter(items).items() if n > 1}


def _spread_colour(i: int) -> tuple[int, int, int]:
    """Return the i-th of a sequence of colours whose hues are far apart (golden-ratio steps)."""
    hue = (0.58 + 0.61803398875 * i) % 1.0
    red, green, blue = colorsys.hsv_to_rgb(hue, (0.65, 0.85, 0.45)[i % 3], (0.9, 0.7, 0.95)[i // 3 % 3])
    return round(255 * red), round(255 * green), round(255 * blue)
