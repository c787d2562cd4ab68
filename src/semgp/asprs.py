"""What LAS files call things: the classes of the ASPRS, and what reads and writes the files."""

from __future__ import annotations

from typing import Any

from semgp.classes import Classes
from semgp.errors import InputError, MissingExtraError

UNCLASSIFIED = 1
"""The code of a point whose class is not known."""

FIRST_USER_CODE, LAST_CODE = 64, 255
"""Codes from the first to the last are the user's own."""

ASPRS_CODES = {
    "ground": 2,
    "low vegetation": 3,
    "medium vegetation": 4,
    "high vegetation": 5,
    "building": 6,
    "low noise": 7,
    "water": 9,
    "rail": 10,
    "road surface": 11,
    "wire guard": 13,
    "wire conductor": 14,
    "transmission tower": 15,
    "wire connector": 16,
    "bridge deck": 17,
    "high noise": 18,
    "overhead structure": 19,
    "ignored ground": 20,
    "snow": 21,
    "temporal exclusion": 22,
}
"""Code of each class in the ASPRS' LAS Specification 1.4-R15, table 17; the others say nothing or are reserved."""

CLASS_RECORD = ("semgp", 1)
"""User and number of the record in which semgp lists the classes of its labels."""

ASPRS = Classes(tuple(ASPRS_CODES))
"""The same as classes of a map."""


def laspy_for(feature: str) -> Any:
    """Return laspy.

    Raises
    ------
    MissingExtraError
        Without the extra `las`.
    """
    try:
        import laspy
        import lazrs  # noqa: F401
    except ImportError as error:
        raise MissingExtraError(feature, "las") from error
    return laspy


def codes_of(classes: Classes) -> tuple[int, ...]:
    """Return the code of each class: the ASPRS' where all names are theirs, else the user's own ones from 64.

    Raises
    ------
    InputError
        More classes than there are codes.
    """
    n = len(classes)
    if has_asprs_names(classes):
        return tuple(ASPRS_CODES[name.lower()] for name in classes.names)
    if n > LAST_CODE - FIRST_USER_CODE + 1:
        raise InputError(f"LAS files have room for {LAST_CODE - FIRST_USER_CODE + 1} classes, not {n}.")
    return tuple(range(FIRST_USER_CODE, FIRST_USER_CODE + n))


def has_asprs_names(classes: Classes) -> bool:
    """Tell whether all classes are the ASPRS'."""
    return {name.lower() for name in classes.names} <= ASPRS_CODES.keys()
