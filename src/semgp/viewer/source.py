"""What a live viewer asks: a map, or one that playback builds, anew only where a choice needs it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from semgp.errors import InputError
from semgp.maps.protocol import SemanticMap
from semgp.maps.settings import require_positive
from semgp.viewer.fields import field_called
from semgp.viewer.playback import Playback
from semgp.viewer.sample import Sample, take_sample
from semgp.viewer.state import ViewState
from semgp.viewer.surface import Surface

Tell = Callable[[str, float], None]
"""Called with what goes on and the share of it that is done; may raise to give up."""


_HALVED = 6
"""So many times as many points lie half as far apart, discs that overlap counted in."""


class Source:
    """A map, its surface, and the last sample of it.

    Parameters
    ----------
    source : SemanticMap or Playback
        The map, or how it is built.
    most : int
        The most points of a sample.

    Raises
    ------
    InputError
        An empty map, or fewer than one point.
    """

    def __init__(self, source: SemanticMap | Playback, most: int) -> None:
        if most < 1:
            raise InputError(f"a viewer shows at least one point, not {most}.")
        self.playback = source if isinstance(source, Playback) else None
        self.semantic_map = source.begin() if isinstance(source, Playback) else source
        self.surface = Surface.of(self.semantic_map)
        self.probe = self.semantic_map.query(self.surface.positions[:1])
        self._most, self._built = most, self.scans
        self._last: tuple[tuple[float, int], Sample] | None = None

    @property
    def scans(self) -> int:
        """How many scans playback has added; 0 of a map that is finished."""
        return 0 if self.playback is None else self.playback.done

    def first_state(
        self, resolution: float | None, field: str, hide: Iterable[str], off: Iterable[str]
    ) -> ViewState:
        """Return the choices to begin with: those of `LiveViewer`, and which layers are off.

        Raises
        ------
        InputError
            A class or field that the map does not have, or a resolution that is not positive.
        """
        return ViewState(
            resolution=self._usual() if resolution is None else require_positive("resolution", resolution),
            field=field_called(self.probe, field),
            hidden=frozenset(self.semantic_map.classes.index(name) for name in hide),
            scans=self.scans,
            off=frozenset(off),
        )

    def _usual(self) -> float:
        """Return half the spacing of the data; all of it where so many points would not fit, or more data come."""
        spacing, fits = self.surface.spacing, _HALVED * len(self.surface.positions) <= self._most
        return spacing / 2 if fits and self.playback is None else spacing

    def sample(self, state: ViewState, tell: Tell) -> Sample:
        """Return the sample for a state, with scans added and the map asked if need be.

        Raises
        ------
        InputError
            As `Playback.go_to` and `take_sample`.
        """
        if self._last is None or self._last[0] != asks(state):
            self._grow(state.scans, tell)

            def progress(n: int, total: int) -> None:
                tell(f"asking the map: {n:,} of {total:,} points", n / max(total, 1))

            sample = take_sample(self.semantic_map, self.surface, state.resolution, self._most, progress)
            self._last = asks(state), sample
        return self._last[1]

    def _grow(self, scans: int, tell: Tell) -> None:
        if self.playback is None or self._built == scans:
            return
        self.playback.go_to(scans, lambda n, total: tell(f"adding scan {n + 1}", n / total))
        self.semantic_map = self.playback.semantic_map
        self.surface, self._built = Surface.of(self.semantic_map), scans


def asks(state: ViewState) -> tuple[float, int]:
    """Return the choices for which the map is asked anew."""
    return state.resolution, state.scans
