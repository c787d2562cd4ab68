"""Frames of tf: which transform takes one frame to another at a moment, by the rules of tf2.

Poses follow ROS REP-103 and REP-105: `T_parent_child` takes coordinates in the child's frame to the parent's.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.logs.rigid import between, row_of, transform

NS = 1_000_000_000
"""Nanoseconds in a second; stamps are whole nanoseconds, so that two of them can be compared."""


class NoTransformError(InputError):
    """Two frames that cannot be connected at a moment."""


@dataclass
class Track:
    """Poses of one frame in another over time.

    Parameters
    ----------
    stamps : list of int
        Nanoseconds, in the order of arrival.
    rows : list of (7,) arrays
        Position x, y, z in metres and unit quaternion x, y, z, w.
    """

    stamps: list[int] = field(default_factory=list)
    rows: list[NDArray[np.float64]] = field(default_factory=list)
    _sorted: tuple[NDArray[np.int64], NDArray[np.float64]] | None = None

    def add(self, stamp: int, row: NDArray[np.float64]) -> None:
        """Take in one pose."""
        self.stamps.append(stamp)
        self.rows.append(row)
        self._sorted = None

    def forget(self, seconds: float) -> None:
        """Drop samples more than so many seconds older than the last to arrive."""
        oldest = self.stamps[-1] - seconds * NS
        if self.stamps[0] < oldest - seconds * NS:  # now and then, not each time
            kept = [i for i, stamp in enumerate(self.stamps) if stamp >= oldest]
            self.stamps, self.rows = [self.stamps[i] for i in kept], [self.rows[i] for i in kept]
            self._sorted = None

    def around(self, stamp: int, max_gap: float, what: str) -> tuple[int, int, float]:
        """Return the samples before and after a moment, and how far it is from the first to the second, 0 to 1.

        Raises
        ------
        NoTransformError
            A moment before the first sample or after the last, or within a gap of more than `max_gap` seconds.
        """
        stamps, _ = self.in_order()
        after = int(np.searchsorted(stamps, stamp))
        if after < len(stamps) and stamps[after] == stamp:
            return after, after, 0.0
        if after in (0, len(stamps)):
            first, last = stamps[0] / NS, stamps[-1] / NS
            raise NoTransformError(
                f"{what} is known from {first:.3f} s to {last:.3f} s, not at {stamp / NS:.3f} s."
            )
        gap = int(stamps[after] - stamps[after - 1])
        if gap > max_gap * NS:
            raise NoTransformError(
                f"{what} has a gap of {gap / NS:.2f} s at {stamp / NS:.3f} s, longer than max_gap = {max_gap:g} s."
            )
        return after - 1, after, (stamp - int(stamps[after - 1])) / gap

    def at(self, stamp: int, max_gap: float, what: str) -> NDArray[np.float64]:
        """Return the pose (4, 4) at a moment: position by straight line, rotation by slerp."""
        before, after, share = self.around(stamp, max_gap, what)
        _, rows = self.in_order()
        return transform(between(rows[before], rows[after], share))

    def in_order(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return stamps (n,) and rows (n, 7) in the order of time; of equal stamps, the last to arrive stays."""
        if self._sorted is None:
            stamps = np.array(self.stamps[::-1], dtype=np.int64)
            unique, where = np.unique(stamps, return_index=True)
            self._sorted = unique, np.array(self.rows[::-1]).reshape(-1, 7)[where]
        return self._sorted


class Frames:
    """The tree of frames that messages of /tf and /tf_static describe.

    Parameters
    ----------
    max_gap : float
        Seconds between two samples of a moving frame up to which its pose between them is believed.
    """

    def __init__(self, max_gap: float = 1.0) -> None:
        self.max_gap = max_gap
        self._moving: dict[str, dict[str, Track]] = {}  # child: parent: track
        self._fixed: dict[str, dict[str, list[NDArray[np.float64]]]] = {}

    def add(self, message: Any, *, fixed: bool) -> None:
        """Take in a tf2_msgs/TFMessage of /tf, or of /tf_static if `fixed`.

        As in tf2, transforms that are not finite or whose quaternion has no unit length are not taken.
        """
        for stamped in message.transforms:
            row = row_of(stamped.transform.translation, stamped.transform.rotation)
            if row is None:
                continue
            parent, child = bare(stamped.header.frame_id), bare(stamped.child_frame_id)
            if fixed:
                said, T = self._fixed.setdefault(child, {}).setdefault(parent, []), transform(row)
                if not any(np.allclose(T, before, rtol=0, atol=1e-6) for before in said):
                    said.append(T)
            else:
                track = self._moving.setdefault(child, {}).setdefault(parent, Track())
                track.add(stamp_of(stamped.header), row)

    def forget(self, seconds: float) -> None:
        """Drop samples of moving frames so many seconds older than the last to arrive, as a node must."""
        for tracks in self._moving.values():
            for track in tracks.values():
                track.forget(seconds)

    @property
    def names(self) -> list[str]:
        """All frames, in the order of the alphabet."""
        children = self._moving.keys() | self._fixed.keys()
        parents = (parent for edges in (self._moving, self._fixed) for of in edges.values() for parent in of)
        return sorted(children.union(parents))

    def root(self, frame: str) -> str:
        """Return the frame that the chain of parents of a frame ends in: itself where tf does not know it."""
        return self._chain(frame)[-1]

    def lookup(self, target: str, source: str, stamp: int) -> NDArray[np.float64]:
        """Return `T_target_source` (4, 4) at a moment in nanoseconds.

        Raises
        ------
        NoTransformError
            Frames that tf does not connect, or not at that moment.
        """
        up = self._chain(source, target)
        down = [target] if up[-1] == target else self._chain(target)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            known = ", ".join(self.names) or "nothing"
            raise NoTransformError(f"no transform from {source!r} to {target!r}: tf knows {known}.")
        climbed = [self._climb(chain[: chain.index(common) + 1], stamp) for chain in (down, up)]
        return np.asarray(np.linalg.solve(climbed[0], climbed[1]))

    def _climb(self, chain: list[str], stamp: int) -> NDArray[np.float64]:
        """Return the pose of the first frame of a chain of parents in the last."""
        T = np.eye(4)
        for child, parent in pairwise(chain):
            T = self._step(child, parent, stamp) @ T
        return T

    def _step(self, child: str, parent: str, stamp: int) -> NDArray[np.float64]:
        if child in self._moving:
            return self._moving[child][parent].at(stamp, self.max_gap, f"{child!r} in {parent!r}")
        said = self._fixed[child][parent]
        if len(said) > 1:
            raise NoTransformError(f"/tf_static says different things of {child!r} in {parent!r}.")
        return said[0]

    def moves(self, frame: str) -> bool:
        """Tell whether anything moves on the way from a frame to its root."""
        return any(name in self._moving for name in self._chain(frame))

    def _chain(self, frame: str, last: str | None = None) -> list[str]:
        """Return a frame, its parent, the parent's parent and so on, up to the root or to the last asked for."""
        chain = [frame]
        while True:
            if chain[-1] == last:
                return chain
            parents = sorted(self._moving.get(chain[-1], {}).keys() | self._fixed.get(chain[-1], {}).keys())
            if not parents:
                return chain
            if len(parents) > 1 or (chain[-1] in self._moving and chain[-1] in self._fixed):
                raise NoTransformError(
                    f"tf is no tree: it has {chain[-1]!r} both moving and fixed, or in several frames "
                    f"({', '.join(parents)})."
                )
            if parents[0] in chain:
                raise NoTransformError(f"tf is no tree: it goes round in a circle at {parents[0]!r}.")
            chain.append(parents[0])


def bare(frame: str) -> str:
    """Return a frame's name without the slash that ROS 1 puts before some."""
    return frame.removeprefix("/")


def stamp_of(header: Any) -> int:
    """Return the stamp of a std_msgs/Header in nanoseconds."""
    return int(header.stamp.sec) * NS + int(header.stamp.nanosec)
