"""A map that grows scan by scan, forward and from the start again."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.protocol import SemanticMap


class Playback:
    """The building of a map.

    Parameters
    ----------
    scans : sequence of LabelledCloud
        What it is built from, in this order; a lazy sequence is read scan by scan.
    begin : callable
        Makes an empty map.

    Raises
    ------
    InputError
        No scans.
    """

    def __init__(self, scans: Sequence[LabelledCloud], begin: Callable[[], SemanticMap]) -> None:
        if not len(scans):
            raise InputError("there are no scans to play: give point files or a data-set folder.")
        self.scans, self._empty = scans, begin
        self.semantic_map = begin()
        self.done = 0

    def __len__(self) -> int:
        return len(self.scans)

    def begin(self) -> SemanticMap:
        """Add scans until the map has data, at least one, and return it.

        Raises
        ------
        InputError
            No scan has a label.
        """
        for done in range(max(1, self.done), len(self) + 1):
            self.go_to(done)
            if len(self.semantic_map.positions):
                return self.semantic_map
        raise InputError("no scan has a label: there is no map to play. `semgp segment` labels images.")

    def go_to(self, done: int, progress: Callable[[int, int], None] | None = None) -> None:
        """Build the map of the first `done` scans; of fewer than it has, from the start again.

        Parameters
        ----------
        done : int
            From 1 to the number of scans.
        progress : callable, optional
            Called with the scans done and wanted before each; may raise to stop between two scans.

        Raises
        ------
        InputError
            Another number of scans, or a scan that the map refuses.
        """
        if not 1 <= done <= len(self):
            raise InputError(f"the map is built from 1 to {len(self)} scans, not {done}.")
        if done < self.done:
            self.semantic_map, self.done = self._empty(), 0
        while self.done < done:
            if progress is not None:
                progress(self.done, done)
            self.semantic_map.update(self.scans[self.done])
            self.done += 1
