"""Write points as comma-separated text, for spreadsheets and scripts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from semgp.classes import Classes
from semgp.writers.atomic import atomic_write
from semgp.writers.columns import Columns, coordinates, number_column, probability_columns, rgb_column


def write_csv(
    path: str | Path,
    points: ArrayLike,
    *,
    classes: Classes | None = None,
    colours: ArrayLike | None = None,
    probability: ArrayLike | None = None,
    **fields: ArrayLike,
) -> None:
    """Write points and what is known about each as text, a header and a line a point.

    Parameters
    ----------
    path : str or Path
        The file, replaced where it exists.
    points : (N, 3) array
        Coordinates in metres, written to a tenth of a millimetre.
    classes : Classes, optional
        Names of the columns of `probability`.
    colours : (N, 3) uint8 array, optional
        Written as `red`, `green`, `blue`.
    probability : (N, C) array, optional
        Class probabilities or weights, written as one column `p_<class name>` a class; needs `classes`.
    **fields : (N,) arrays
        Further columns under their own names.

    Raises
    ------
    InputError
        Arrays of other lengths, probabilities without classes.
    """
    X = np.asarray(points, dtype=np.float64)
    coordinates(X)  # refuses what is none
    n = len(X)
    columns: Columns = list(zip("xyz", X.T))
    if colours is not None:
        columns += zip(("red", "green", "blue"), rgb_column(colours, n).T)
    if probability is not None:
        columns += probability_columns(probability, classes, n)
    columns += [(name, number_column(name, values, n)) for name, values in fields.items()]
    names = [name.replace(",", "_") for name, _ in columns]
    formats = [
        "%.4f" if name in "xyz" else "%.6g" if column.dtype.kind == "f" else "%d" for name, column in columns
    ]
    table = np.empty(n, dtype=[(f"c{i}", column.dtype) for i, (_, column) in enumerate(columns)])
    for i, (_, column) in enumerate(columns):
        table[f"c{i}"] = column
    with atomic_write(path) as temporary:
        np.savetxt(temporary, table, fmt=",".join(formats), header=",".join(names), comments="", encoding="utf-8")
