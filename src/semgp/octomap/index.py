"""Rows for Morton codes, in order of first appearance, in little memory."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.errors import InputError

Scalar = TypeVar("Scalar", bound=np.generic)


class CodeIndex:
    """Rows 0, 1, 2 ... of distinct codes.

    A hash table with linear probing. It is frugal, for maps of many voxels: 32-bit slots, up to three quarters
    of them full, and no more than an eighth of spare rows.
    """

    def __init__(self) -> None:
        self._n = 0
        self._codes = np.empty(0, dtype=np.int64)
        self._slots = np.full(4, -1, dtype=np.int32)

    def __len__(self) -> int:
        return self._n

    @property
    def codes(self) -> NDArray[np.int64]:
        """Code of each row."""
        return self._codes[: self._n]

    @property
    def n_bytes(self) -> int:
        """Memory held, in bytes."""
        return self._codes.nbytes + self._slots.nbytes

    def add(self, codes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the row of each code; codes not met before get new rows."""
        rows = np.empty(len(codes), dtype=np.int64)
        self._slots, self._codes, self._n = _add(codes, self._slots, self._codes, self._n, rows)
        return rows

    def find(self, codes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the row of each code, -1 for codes that have none."""
        rows = np.empty(len(codes), dtype=np.int64)
        _find(codes, self._slots, self._codes, rows)
        return rows

    def trim(self) -> None:
        """Give spare rows back."""
        self._codes = self._codes[: self._n].copy()


def room_for(array: NDArray[Scalar], n: int) -> NDArray[Scalar]:
    """Return the array itself if it has n rows or more, else a copy with room for n and an eighth more.

    Rows that are new hold zeros.
    """
    if n <= len(array):
        return array
    larger = np.zeros((n + n // 8, *array.shape[1:]), dtype=array.dtype)
    larger[: len(array)] = array
    return larger


def require_ascending(name: str, codes: NDArray[np.int64], limit: int) -> None:
    """Check that stored codes ascend strictly, from 0 on, and stay below a limit.

    Raises
    ------
    InputError
        Codes that do not.
    """
    if len(codes) and (codes[0] < 0 or codes[-1] >= limit or (np.diff(codes) <= 0).any()):
        raise InputError(f"the stored array {name!r} does not ascend from 0 to less than {limit}.")


@njit(cache=True, nogil=True)
def first_slot(code: int, n_slots: int) -> int:
    """Return the slot where the search for a code begins (Fibonacci hashing)."""
    mixed = np.uint64(code) * np.uint64(0x9E3779B97F4A7C15)
    return int(mixed >> np.uint64(32)) & (n_slots - 1)


@njit(cache=True, nogil=True)
def slots_of(codes: NDArray[np.int64], n: int, capacity: int) -> NDArray[np.int32]:
    """Return the slots of the first n codes, at most three quarters full with `capacity` codes."""
    size = 4
    while 3 * size < 4 * capacity:
        size *= 2
    slots = np.full(size, -1, dtype=np.int32)
    for row in range(n):
        slot = first_slot(codes[row], size)
        while slots[slot] >= 0:
            slot = (slot + 1) & (size - 1)
        slots[slot] = row
    return slots


# The search for a code is written out where it is done: a call would count references to the arrays that it is
# given, with atomic operations that take longer than the search.


@njit(cache=True, nogil=True)
def _add(
    new: NDArray[np.int64],
    slots: NDArray[np.int32],
    codes: NDArray[np.int64],
    n: int,
    rows: NDArray[np.int64],
) -> tuple[NDArray[np.int32], NDArray[np.int64], int]:
    for i in range(len(new)):
        if n == len(codes):
            larger = np.empty(n + n // 8 + 64, dtype=np.int64)
            larger[:n] = codes
            codes = larger
        if 4 * (n + 1) > 3 * len(slots):
            slots = slots_of(codes, n, 2 * n)
        slot = first_slot(new[i], len(slots))
        while slots[slot] >= 0 and codes[slots[slot]] != new[i]:
            slot = (slot + 1) & (len(slots) - 1)
        if slots[slot] < 0:
            slots[slot] = n
            codes[n] = new[i]
            n += 1
        rows[i] = slots[slot]
    return slots, codes, n


@njit(cache=True, nogil=True)
def _find(
    wanted: NDArray[np.int64],
    slots: NDArray[np.int32],
    codes: NDArray[np.int64],
    rows: NDArray[np.int64],
) -> None:
    for i in range(len(wanted)):
        slot = first_slot(wanted[i], len(slots))
        while slots[slot] >= 0 and codes[slots[slot]] != wanted[i]:
            slot = (slot + 1) & (len(slots) - 1)
        rows[i] = slots[slot]
