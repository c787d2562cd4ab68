"""Files and folders that commands are given: what is absent is told before all that reads it is imported."""

from __future__ import annotations

from pathlib import Path

from semgp.errors import InputError


def require_place(*places: Path) -> None:
    """Check that there is something at places that are no URLs.

    Raises
    ------
    InputError
        Nothing is there.
    """
    for place in places:
        if ":/" not in str(place) and not place.exists():
            raise InputError(f"{place}: no such file or folder.")


def named(place: Path) -> str:
    """Return a place as people write it: of a URL that is a path for a while, one slash is gone."""
    from semgp.store.bucket import as_url

    return as_url(place) or str(place)
