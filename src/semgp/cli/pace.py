"""The progress bar's last column: how many are done, how fast, and the time that is left."""

from __future__ import annotations

import math

from rich.progress import ProgressColumn, Task
from rich.text import Text


class Pace(ProgressColumn):
    """How many are done, how fast, and the time that is left; nothing where the total is not known."""

    def render(self, task: Task) -> Text:
        """Return the words for a task."""
        if task.total is None:
            return Text()
        words = f"{task.completed:,.0f}/{task.total:,.0f}"
        speed = task.finished_speed or task.speed
        if speed:
            words += (
                f"  {speed:,.0f}/s"
                if speed >= 10
                else f"  {speed:.1f}/s"
                if speed >= 1
                else f"  {1 / speed:.1f} s each"
            )
        if task.time_remaining:
            minutes, seconds = divmod(math.ceil(task.time_remaining), 60)
            words += f"  {minutes}:{seconds:02d} left"
        return Text(words, style="progress.remaining")
