"""`semgp demo`: a synthetic room, mapped by the GP and by its rivals, as a table, pictures and a saved map."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path


def demo(*, out: Path = Path("semgp-demo"), seed: int = 0) -> None:
    """Map a synthetic room from sparse, partly wrong labels: a table, a picture and a saved map, in a minute.

    Example: semgp demo --out my-demo

    Parameters
    ----------
    out
        The folder to write to.
    seed
        Seed of the room, its sensor and the training subset.
    """
    from semgp.cli.console import STDOUT, keeping, progress, report, require_folder, score_table
    from semgp.evaluation.demo import METHODS, demo_pictures, demo_task, warm_up
    from semgp.evaluation.task import run
    from semgp.maps.files import save_map
    from semgp.maps.gp import GPSemanticMap
    from semgp.picture.image import save_png

    require_folder(out)
    with keeping(lambda: _kept(out)), progress() as bars:
        bar = bars.add_task("scanning a synthetic room", total=len(METHODS) + 2)
        scan, task = demo_task(seed)
        results = []
        with ThreadPoolExecutor(1) as beside:
            compiled = beside.submit(warm_up, task)
            for name, method in METHODS.items():
                bars.update(bar, advance=1, description=f"mapping it: {name}")
                results.append(run(task, name, method))
                compiled.result()
        bars.update(bar, advance=1, description="drawing")
        gp = results[0]
        assert gp.prediction is not None
        assert isinstance(gp.semantic_map, GPSemanticMap)
        for name, picture in demo_pictures(scan, gp.prediction).items():
            save_png(out / f"{name}.png", picture)
        save_map(gp.semantic_map, out / "room.semgp")
    columns = ("method", "auc", "accuracy", "miou", "nll", "ece", "fit_seconds", "query_seconds")
    rows = [result.row() for result in results]
    report(score_table("A synthetic room, sparse and partly wrong labels", rows, columns), out=out, rows=rows)
    STDOUT.print(f"{out}/overview.png shows it; {out}/room.semgp is the map. Next: semgp info {out}/room.semgp")


def _kept(out: Path) -> str:
    """What Ctrl-C leaves."""
    made = sorted(path.name for path in out.iterdir()) if out.is_dir() else []
    return f"{out} holds {', '.join(made) or 'nothing yet'}."
