"""The application: its commands, and how it ends."""

from __future__ import annotations

import sys

from cyclopts import App, CycloptsError

from semgp.cli.console import STDERR
from semgp.cli.reproduce import reproduce
from semgp.errors import SemgpError

app = App(
    name="semgp",
    help="Continuous semantic maps by Gaussian processes: class probabilities and uncertainty at any point.",
)
app.command("semgp.cli.demo:demo")
app.command("semgp.cli.build:build")
app.command("semgp.cli.build:learn")
app.command("semgp.cli.maps:query")
app.command("semgp.cli.maps:evaluate")
app.command("semgp.cli.maps:info")
app.command("semgp.cli.space:fuse")
app.command("semgp.cli.space:surface")
app.command("semgp.cli.space:slice_", name="slice")
app.command(reproduce)


def main(arguments: list[str] | None = None) -> None:
    """Run one command; exit with 0, with 2 after bad input, with 130 after Ctrl-C."""
    try:
        app(arguments, exit_on_error=False, print_error=True)
    except CycloptsError:
        sys.exit(2)
    except SemgpError as error:
        STDERR.print("[bold red]error:[/] ", end="")
        STDERR.print(str(error), markup=False, highlight=False)
        sys.exit(2)
    except KeyboardInterrupt:
        STDERR.print("interrupted")
        sys.exit(130)
