"""The application: its commands, and how it ends."""

from __future__ import annotations

import sys
import traceback
import warnings
from typing import Annotated, Any

from cyclopts import App, CycloptsError, Group, Parameter
from rich.markup import escape

from semgp.cli.console import MANNERS, STDERR, behave
from semgp.cli.reproduce import reproduce
from semgp.errors import SemgpError

app = App(
    name="semgp",
    help="Continuous semantic maps by Gaussian processes: class probabilities and uncertainty at any point.",
    default_parameter=Parameter(negative_iterable=()),
    suppress_keyboard_interrupt=False,
)
app.meta.suppress_keyboard_interrupt = False  # `main` says what Ctrl-C leaves
app.command("semgp.cli.demo:demo")
app.command("semgp.cli.build:build")
app.command("semgp.cli.update:update")
app.command("semgp.cli.learn:learn")
app.command("semgp.cli.query:query")
app.command("semgp.cli.evaluate:evaluate")
app.command("semgp.cli.info:info")
app.command("semgp.cli.export:export")
app.command("semgp.cli.render:render")
app.command("semgp.cli.ros2:ros2")
app.command("semgp.cli.ros2:topics")
app.command("semgp.cli.segment:segment")
app.command("semgp.cli.serve:serve")
app.command("semgp.cli.parts:crop")
app.command("semgp.cli.parts:fuse")
app.command("semgp.cli.space:surface")
app.command("semgp.cli.slices:slice_", name="slice")
app.command("semgp.cli.view:view")
app.command("semgp.cli.store:store_app", name="store")
app.command(reproduce)


_EVERYWHERE = Group("With every command")
Wish = Annotated[bool, Parameter(negative="", group=_EVERYWHERE, show_default=False)]


@app.meta.default
def launch(
    *tokens: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
    quiet: Wish = False,
    verbose: Annotated[Wish, Parameter(name=("--verbose", "-v"))] = False,
    json: Wish = False,
) -> Any:
    """Run the command that the tokens name.

    Parameters
    ----------
    tokens
        The command with its own arguments.
    quiet
        Show neither progress nor results; errors are shown.
    verbose
        Show how long each part took and, after an error, where it came from.
    json
        Write the result to standard output as JSON instead of words.
    """
    behave(quiet=quiet, verbose=verbose, json=json)
    return app(tokens)


def _tell(message: Warning | str, *_: Any, **__: Any) -> None:
    """Show a warning as one line for people."""
    if not MANNERS.quiet:
        STDERR.print(f"[yellow]warning:[/] {escape(str(message))}", highlight=False, soft_wrap=True)


def main(arguments: list[str] | None = None) -> None:
    """Run one command; exit with 0, with 2 after bad input, with 130 after Ctrl-C."""
    tokens = sys.argv[1:] if arguments is None else arguments
    if not tokens or tokens[0] in app.help_flags:
        app.resolved_commands()  # the list of commands shows what each one's docstring says
    warnings.showwarning = _tell
    try:
        app.meta(tokens, exit_on_error=False, print_error=True)
    except CycloptsError:
        sys.exit(2)
    except (SemgpError, OSError) as error:
        if MANNERS.verbose:
            traceback.print_exception(error)
        STDERR.print("[bold red]error:[/] ", end="")
        STDERR.print(str(error), markup=False, highlight=False, soft_wrap=True)
        sys.exit(2)
    except KeyboardInterrupt as stop:
        STDERR.print(f"interrupted: {str(stop) or 'no file is left half written.'}", markup=False, highlight=False)
        sys.exit(130)
