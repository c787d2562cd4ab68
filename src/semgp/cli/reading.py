"""Reading scans of several sequences in one list of classes."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from semgp.class_files import ClassFile
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.remapping import remapped, without_counterpart


class Reading:
    """Reads scan k of several sequences, all in the same classes, and counts labels."""

    def __init__(
        self,
        parts: Sequence[Sequence[LabelledCloud]],
        chosen: Sequence[int],
        mapping: ClassFile | None,
        count_classes: bool,
    ) -> None:
        self._parts, self._chosen, self._mapping, self._count_classes = parts, chosen, mapping, count_classes
        self._counted: set[int] = set()
        self._seen: set[int] = set()
        self.dropped: Counter[str] = Counter()
        self.points, self.nameless = 0, False
        self.names: tuple[str, ...] = ()
        self.labels = np.zeros(0, dtype=np.int64)
        self._starts = np.cumsum([0] + [len(part) for part in parts]).tolist()
        self._classes: Classes | None = None if mapping is None else mapping.classes

    def __call__(self, k: int) -> LabelledCloud:
        """Return scan k."""
        cloud = self._read(k)
        if self._classes is None:
            first = cloud if k == self._chosen[0] else self._read(self._chosen[0])
            self._classes = (
                self._most_classes() if first.classes.nameless and self._count_classes else first.classes
            )
        cloud = cloud if cloud.classes == self._classes else in_classes(cloud, self._classes, f"scan {k}")
        if k not in self._seen:
            self._seen.add(k)
            self._count(cloud)
        return cloud

    def _count(self, cloud: LabelledCloud) -> None:
        """Add up points and labels, of each scan once."""
        self.names, self.nameless = cloud.classes.names, cloud.classes.nameless
        labels = np.bincount(cloud.hard_labels[cloud.labelled], minlength=len(self.names))
        self.labels = labels if not self.points else self.labels + labels
        self.points += len(cloud)

    def _most_classes(self) -> Classes:
        """Return the classes of a scan that names them or, where none does, the most that any scan has."""
        return max((self._read(k).classes for k in self._chosen), key=lambda c: (not c.nameless, len(c)))

    def _read(self, k: int) -> LabelledCloud:
        part = bisect_right(self._starts, k) - 1
        cloud: LabelledCloud = self._parts[part][k - self._starts[part]]
        if self._mapping is None:
            return cloud
        if k not in self._counted:
            self._counted.add(k)
            self.dropped.update(without_counterpart(cloud, self._mapping))
        return remapped(cloud, self._mapping)


def in_classes(cloud: LabelledCloud, classes: Classes, what: str) -> LabelledCloud:
    """Return a cloud in the classes that are wanted: by name or, where it only numbers its own, by number.

    Raises
    ------
    InputError
        A cloud of other classes.
    """
    own = cloud.classes
    if set(own.names) <= set(classes.names):
        return remapped(cloud, ClassFile(classes))
    if own.nameless and len(own) <= len(classes):
        more = len(classes) - len(own)
        weights = None if cloud.weights is None else np.pad(cloud.weights, ((0, 0), (0, more)))
        return replace(cloud, classes=classes, weights=weights)
    raise InputError(
        f"the classes of {what} ({', '.join(own.names)}) are not those wanted ({', '.join(classes.names)}): "
        "say what its labels mean with --classes, or turn them into the others with --remap."
    )
