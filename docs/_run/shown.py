"""What the pages' code cells call: a command with what it prints, an example with its picture."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

from IPython.display import Image, display

PLAIN = {k: v for k, v in os.environ.items() if not k.endswith(("COLOR", "COLOR_FORCE"))} | {"COLUMNS": "100"}
"""Jupyter asks for colours and moving bars, which a page cannot show."""
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def console(*commands: str) -> None:
    """Run commands one after the other, and print each with what it prints."""
    for command in commands:
        program, *arguments = shlex.split(command)
        ran = subprocess.run(
            [Path(sys.executable).with_name(program), *arguments],
            capture_output=True,
            text=True,
            env=PLAIN,
        )
        said = "\n".join(line.rstrip() for line in (ran.stdout + ran.stderr).strip().splitlines())
        sys.stdout.write(f"$ {command}\n{said}\n\n" if said else f"$ {command}\n\n")
        if ran.returncode:
            raise RuntimeError(f"{command}: exit status {ran.returncode}")


def example(name: str) -> None:
    """Run an example of the course; show what it prints, and its picture."""
    script = EXAMPLES / f"{name}.py"
    subprocess.run([sys.executable, script, "--out", f"{name}.png"], check=True)
    display(Image(f"{name}.png", alt=script.read_text().splitlines()[0].strip('"')))
