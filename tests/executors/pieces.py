"""Work for executors: functions that other processes can import, and what they leave behind."""

import os
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.store import MapStore, Settings
from tests.store import scenes

CLOUDS = [scenes.cloud(i, 2.5 * i, n=200) for i in range(10)]
"""The street."""


def square(x: int) -> int:
    return x * x


def divide(x: int) -> list[NDArray[np.int64]]:
    """The numbers below x by their remainder by three."""
    return [np.arange(x)[np.arange(x) % 3 == part] for part in range(3)]


def join(parts: Sequence[NDArray[np.int64]]) -> list[int]:
    return [int(n) for part in parts for n in part]


def refuse(x: int) -> int:
    if x == 2:
        raise InputError("two is refused.")
    return x


def refuse_all(_: Sequence[NDArray[np.int64]]) -> int:
    return refuse(2)


def damaged(_: int) -> NoReturn:
    raise FileFormatError("s3://bucket/tile.npz", "is damaged.")


def lacking(_: int) -> NoReturn:
    raise MissingExtraError("this", "that")


def broken(_: int) -> NoReturn:
    raise ZeroDivisionError("a bug")


def here(_: int) -> str:
    return os.getcwd()


def die(_: int) -> NoReturn:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


@dataclass(frozen=True)
class Slow(Sequence[LabelledCloud]):
    """Clouds that say who reads them, and take a while: long enough to be killed at any moment."""

    clouds: Sequence[LabelledCloud]
    readers: Path
    seconds: float

    def __len__(self) -> int:
        return len(self.clouds)

    def __getitem__(self, i: Any) -> Any:
        (self.readers / f"{os.getpid()}-{i}").touch()
        time.sleep(self.seconds)
        return self.clouds[i]


def new_store(folder: Path | str, settings: Settings) -> MapStore:
    store = MapStore(folder)
    store.create(settings)
    return store


Work = Callable[[int], Any]
