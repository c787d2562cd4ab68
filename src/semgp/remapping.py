"""From the classes of one list to those of another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgp.class_files import ClassFile
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError


def remapped(cloud: LabelledCloud, mapping: ClassFile) -> LabelledCloud:
    """Return a cloud in the classes of a mapping; labels without a counterpart become missing.

    Soft labels are added up; the weight of classes without a counterpart is dropped, and a row that loses all of
    its weight is a missing label.

    Parameters
    ----------
    cloud : LabelledCloud
        Its classes are the old ones.
    mapping : ClassFile
        The new classes, with what each takes in; see `remapping_table`.

    Raises
    ------
    InputError
        A mapping that knows none of the cloud's classes.
    """
    table = remapping_table(cloud.classes, mapping)
    labels = None if cloud.labels is None else np.append(table, MISSING)[cloud.labels]
    weights = None
    if cloud.weights is not None:
        weights = cloud.weights @ (table[:, None] == np.arange(len(mapping.classes))).astype(cloud.weights.dtype)
    return replace(cloud, classes=mapping.classes, labels=labels, weights=weights)


def remapping_table(old: Classes, mapping: ClassFile) -> NDArray[np.int32]:
    """Return the new label of each old one, shape (C_old,), `MISSING` where there is none.

    A new class takes in the old ones that its `from` names, and the one of its own name unless another class takes
    that. Old classes without names are taken by their numbers, the mapping's ids, where it has some.

    Raises
    ------
    InputError
        A mapping that knows none of the old classes.
    """
    new = mapping.classes
    if old.nameless and new.ids:
        table = new.from_ids(np.arange(len(old)))
    else:
        target = {name: c for c, name in enumerate(new.names)}
        target |= {name: c for c, names in enumerate(mapping.members) for name in names}
        table = np.array([target.get(name, MISSING) for name in old.names])
    if (table == MISSING).all():
        raise InputError(
            f"the mapping to {', '.join(new.names)} takes in none of the classes {', '.join(old.names)}: "
            "name them in its 'from'."
        )
    return table.astype(np.int32)


def without_counterpart(cloud: LabelledCloud, mapping: ClassFile) -> dict[str, int]:
    """Return how many labels of each old class a mapping drops, for the classes where it drops some."""
    lost = np.flatnonzero(remapping_table(cloud.classes, mapping) == MISSING)
    hard = cloud.hard_labels
    count = np.bincount(hard[hard != MISSING], minlength=len(cloud.classes))
    return {cloud.classes.names[c]: int(count[c]) for c in lost if count[c]}
