"""Reading OctoMap's files; see `semgp.octomap.files` for what is in them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.errors import FileFormatError
from semgp.octomap.files import BINARY_MARK, FULL_MARK, INNER, OCCUPIED, UNSET, record_of
from semgp.octomap.morton import DEPTH
from semgp.octomap.tree import Leaves

MOST_VOXELS, MOST_COLOURED = 1 << 30, 1 << 26
"""A few bytes can say that all the space there is is known, but the map keeps no leaves larger than bricks."""

TRUNCATED, TOO_DEEP, CHILDLESS = -1, -2, -3
PROBLEMS = {
    TRUNCATED: "the file ends in the middle of the tree: it was cut off.",
    TOO_DEEP: f"the tree is deeper than {DEPTH} levels: the file is damaged.",
    CHILDLESS: "an inner node has no children: the file is damaged.",
}


@dataclass(frozen=True)
class _Header:
    binary: bool
    tree: str
    n_nodes: int
    resolution: float
    length: int


def read_tree(path: Path, free: np.float32, occupied: np.float32) -> tuple[float, Leaves, NDArray[np.uint8]]:
    """Read a `.bt` or `.ot` file; its first line, not its name, tells which it is.

    Parameters
    ----------
    path : Path
        The file.
    free, occupied : float32
        Log-odds of the leaves of a `.bt` file.

    Returns
    -------
    resolution : float
        Edge of a voxel in metres.
    leaves : Leaves
        Their states are log-odds.
    colours : (L, 3) array
        Colours of the leaves, all `UNSET` where there is none.

    Raises
    ------
    FileFormatError
        A file that is neither, is damaged, or holds another kind of tree than OcTree and ColorOcTree.
    """
    content = path.read_bytes()
    header = _read_header(path, content)
    body = np.frombuffer(content, dtype=np.uint8, offset=header.length)
    if header.binary:
        cells, depth, kind = _walk(path, header, body, 2)
        values = np.where(kind == OCCUPIED, occupied, free)
        colours = np.full((len(cells), 3), UNSET, dtype=np.uint8)
    else:
        record = record_of(header.tree)
        cells, depth, node = _walk(path, header, body, record.itemsize)
        records = np.frombuffer(content, dtype=record, count=header.n_nodes, offset=header.length)[node]
        values = records["value"].astype(np.float32)
        coloured = header.tree == "ColorOcTree"
        colours = records["colour"] if coloured else np.full((len(cells), 3), UNSET, dtype=np.uint8)
        if not np.isfinite(values).all():
            raise FileFormatError(path, "some log-odds are not finite: the file is damaged.")
    voxels = np.ldexp(1.0, 3 * (DEPTH - depth))
    if voxels.sum() > MOST_VOXELS or voxels[(colours != UNSET).any(axis=1)].sum() > MOST_COLOURED:
        raise FileFormatError(path, "its leaves are so large that they hold more voxels than this map can.")
    first = cells << 3 * (DEPTH - depth)
    order = np.argsort(first)
    return header.resolution, Leaves(first[order], depth[order], values[order]), colours[order]


def _read_header(path: Path, content: bytes) -> _Header:
    if not content.startswith((BINARY_MARK, FULL_MARK)):
        raise FileFormatError(path, "neither a .bt nor a .ot file of OctoMap: its first line is another.")
    text, found, _ = content.partition(b"\ndata\n")
    lines = text.decode("ascii", errors="replace").splitlines()
    fields = dict(line.split(maxsplit=1) for line in lines if len(line.split()) > 1 and line[0] != "#")
    try:
        tree, n_nodes, resolution = fields["id"].strip(), int(fields["size"]), float(fields["res"])
    except (KeyError, ValueError) as error:
        raise FileFormatError(path, f"the header lacks a usable id, size or res ({error}).") from error
    if not found or n_nodes < 0 or not (math.isfinite(resolution) and resolution > 0):
        raise FileFormatError(path, "the header has no data line, or its size or res cannot be.")
    if tree not in ("OcTree", "ColorOcTree"):
        raise FileFormatError(path, f"it holds a tree of kind {tree}; OcTree and ColorOcTree can be read.")
    return _Header(content.startswith(BINARY_MARK), tree, n_nodes, resolution, len(text) + len(found))


def _walk(
    path: Path, header: _Header, body: NDArray[np.uint8], node_bytes: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the code and depth of each leaf, and its kind (`.bt`) or which record of the body it is (`.ot`)."""
    room = 8 * (len(body) // 2) if header.binary else len(body) // node_bytes
    found = np.empty((3, room), dtype=np.int64)
    n_nodes, n_leaves, end = 0, 0, 0
    if header.n_nodes > 0:
        walk = _walk_bt if header.binary else _walk_ot
        n_nodes, n_leaves, end = walk(body, node_bytes, found)
    if end < 0:
        raise FileFormatError(path, PROBLEMS[end])
    if end != len(body) or n_nodes != header.n_nodes:
        raise FileFormatError(
            path,
            f"the header says {header.n_nodes} nodes, but there are {n_nodes}, and {len(body) - end} bytes "
            "after them: the file is damaged.",
        )
    cells, depth, what = found[:, :n_leaves]
    return cells, depth, what


@njit(cache=True, nogil=True)
def _walk_ot(body: NDArray[np.uint8], node_bytes: int, found: NDArray[np.int64]) -> tuple[int, int, int]:
    """Fill in the leaves; return the numbers of nodes and leaves and where the tree ends, or what is wrong."""
    waiting = np.zeros(DEPTH + 1, dtype=np.int64)  # at each depth, the children that are still to come
    n_nodes, n_leaves, cell, depth = 0, 0, 0, 0
    while depth >= 0:
        end = (n_nodes + 1) * node_bytes
        if end > len(body):
            return 0, 0, TRUNCATED
        waiting[depth] = body[end - 1]
        if waiting[depth] == 0:
            found[0, n_leaves], found[1, n_leaves], found[2, n_leaves] = cell, depth, n_nodes
            n_leaves += 1
        elif depth == DEPTH:
            return 0, 0, TOO_DEEP
        n_nodes += 1
        cell, depth = _next_cell(waiting, cell, depth)
    return n_nodes, n_leaves, n_nodes * node_bytes


@njit(cache=True, nogil=True)
def _walk_bt(body: NDArray[np.uint8], node_bytes: int, found: NDArray[np.int64]) -> tuple[int, int, int]:
    """Fill in the leaves; return the numbers of nodes and leaves and where the tree ends, or what is wrong."""
    waiting = np.zeros(DEPTH + 1, dtype=np.int64)
    n_nodes, n_leaves, cell, depth, end = 1, 0, 0, 0, 0
    while depth >= 0:
        if end + node_bytes > len(body):
            return 0, 0, TRUNCATED
        kinds = body[end] | (np.int64(body[end + 1]) << 8)
        end += node_bytes
        if kinds == 0:
            return 0, 0, CHILDLESS
        for place in range(8):
            kind = (kinds >> (2 * place)) & 3
            n_nodes += kind > 0
            if kind == INNER:
                waiting[depth] |= 1 << place
            elif kind > 0:
                found[0, n_leaves], found[1, n_leaves], found[2, n_leaves] = 8 * cell + place, depth + 1, kind
                n_leaves += 1
        if waiting[depth] > 0 and depth == DEPTH - 1:
            return 0, 0, TOO_DEEP
        cell, depth = _next_cell(waiting, cell, depth)
    return n_nodes, n_leaves, end


@njit(cache=True, nogil=True)
def _next_cell(waiting: NDArray[np.int64], cell: int, depth: int) -> tuple[int, int]:
    """Return the next cell to come and its depth, -1 after the last, and strike it off."""
    while depth >= 0 and waiting[depth] == 0:
        cell >>= 3
        depth -= 1
    if depth < 0:
        return 0, -1
    place = 0
    while waiting[depth] >> place & 1 == 0:
        place += 1
    waiting[depth] ^= 1 << place
    return 8 * cell + place, depth + 1
