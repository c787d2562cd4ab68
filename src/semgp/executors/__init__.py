"""Executors: who does independent pieces of work, the threads of one process or the machines of a cluster."""

from semgp.executors.protocol import Executor, Steps
from semgp.executors.threads import Threads

__all__ = ["Executor", "Steps", "Threads", "open_executor"]


def open_executor(name: str, workers: int | None = None, address: str | None = None) -> Executor:
    """Return an executor by its name on the command line.

    Parameters
    ----------
    name : str
        "threads" or "ray".
    workers : int, optional
        How many; as many as there are cores by default. Not for a cluster that is there already.
    address : str, optional
        Address of a Ray cluster, "auto" for the one this machine belongs to; by default one of this machine alone
        is started, and stopped at the end.

    Raises
    ------
    InputError
        Another name, or an address where there is no cluster; MissingExtraError without Ray.
    """
    from semgp.errors import InputError

    if name == "ray":
        from semgp.executors.ray import RayExecutor

        return RayExecutor(workers, address)
    if name != "threads":
        raise InputError(f"an executor is threads or ray, not {name!r}.")
    if address is not None:
        raise InputError("threads have no address: leave it out, or use the executor ray.")
    return Threads(workers)
