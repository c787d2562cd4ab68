"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

JsonOut = Annotated[Path | None, Parameter(allow_leading_hyphen=True)]
"""Where to write JSON; "-" is standard output."""
