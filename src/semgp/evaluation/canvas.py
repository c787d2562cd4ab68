"""Where curves and diagrams are drawn: matplotlib, apart from pyplot and its state."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from semgp.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

DOTS_PER_INCH = 200
BLUE, RED, GREY = "#3b6ea5", "#c8553d", "#8a8f98"


def require_matplotlib() -> None:
    """Check that curves can be drawn, before an experiment whose report needs them is run.

    Raises
    ------
    MissingExtraError
        The extra `figures` is not installed.
    """
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("drawing curves", "figures") from error


def canvas(width: float, height: float) -> Canvas:
    """Return an empty matplotlib figure of a size in inches.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    require_matplotlib()
    from matplotlib.figure import Figure as Canvas

    return Canvas(figsize=(width, height), dpi=DOTS_PER_INCH, layout="constrained")


def png(drawn: Canvas) -> bytes:
    """Return a matplotlib figure as a PNG file."""
    file = io.BytesIO()
    drawn.savefig(file, format="png")
    return file.getvalue()
