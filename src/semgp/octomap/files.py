"""Writing OctoMap's files: `.bt`, which says occupied or free, and `.ot`, which keeps log-odds and colours.

A file is a few lines of text, then the nodes of the tree, parents first. In a `.ot` file a node is its
log-odds (float32, little endian), in a ColorOcTree its colour, and a byte that tells which children follow. In
a `.bt` file an inner node is two bytes, two bits a child (`UNKNOWN`, `FREE`, `OCCUPIED`, `INNER`); leaves have
none of their own.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgp.octomap.morton import DEPTH
from semgp.octomap.tree import Leaves, Nodes, nodes_of
from semgp.writers import atomic_write

BINARY_MARK = b"# Octomap OcTree binary file\n"
FULL_MARK = b"# Octomap OcTree file\n"
"""First lines of the files."""

UNKNOWN, FREE, OCCUPIED, INNER = range(4)

UNSET = 255
"""A node whose red, green and blue are all this has no colour."""


def write_bt(path: Path, leaves: Leaves, resolution: float) -> None:
    """Write leaves whose state is `FREE` or `OCCUPIED`."""
    nodes = nodes_of(leaves)
    inner = nodes.leaf < 0
    kind = np.where(inner, INNER, nodes.state)
    words = nodes.gathered(kind << 2 * nodes.place)[inner].astype("<u2")
    _write(path, BINARY_MARK, "OcTree", len(nodes), resolution, words.tobytes())


def write_ot(path: Path, leaves: Leaves, resolution: float, colours: NDArray[np.uint8] | None = None) -> None:
    """Write leaves whose state is their log-odds: an OcTree, or with colours (L, 3) a ColorOcTree."""
    nodes = nodes_of(leaves)
    tree = "OcTree" if colours is None else "ColorOcTree"
    records = np.zeros(len(nodes), dtype=record_of(tree))
    records["value"], records["children"] = nodes.state, nodes.children
    if colours is not None:
        records["colour"] = _node_colours(nodes, colours)
    _write(path, FULL_MARK, tree, len(nodes), resolution, records.tobytes())


def record_of(tree: str) -> np.dtype[np.void]:
    """Return the layout of a node in a `.ot` file."""
    colour = [("colour", np.uint8, 3)] if tree == "ColorOcTree" else []
    return np.dtype([("value", "<f4"), *colour, ("children", np.uint8)])


def _node_colours(nodes: Nodes, colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the colour of each node; of an inner one, the mean, rounded down, of its children that have any."""
    found = np.full((len(nodes), 3), UNSET, dtype=np.int64)
    found[nodes.leaf >= 0] = colours[nodes.leaf[nodes.leaf >= 0]]
    for depth in range(DEPTH, 0, -1):
        child = np.flatnonzero((nodes.depth == depth) & (found != UNSET).any(axis=1))
        parents, place = np.unique(nodes.parent[child], return_inverse=True)
        total = np.stack([np.bincount(place, found[child, channel]) for channel in range(3)], axis=1)
        found[parents] = total // np.bincount(place)[:, None]
    return found.astype(np.uint8)


def _write(path: Path, mark: bytes, tree: str, n_nodes: int, resolution: float, body: bytes) -> None:
    header = (
        "# (feel free to add / change comments, but leave the first line as it is!)\n"
        f"#\nid {tree}\nsize {n_nodes}\nres {resolution!r}\ndata\n"
    )
    with atomic_write(path) as temporary:
        temporary.write_bytes(mark + header.encode() + body)
