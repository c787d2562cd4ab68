"""Scans of `SyntheticTown` in files, and new stores for maps of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.maps.free_space import FreeSpace
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.scene.town import SyntheticTown
from semgp.store import MapStore, Settings

STRIDE = 1  # metres, and scans, from one cloud to the next


@dataclass(frozen=True)
class Saved(Sequence[LabelledCloud]):
    """Clouds in files; the first `points` of each, with labels of `n_classes` classes."""

    folder: Path
    n: int
    share: float = 1.0
    n_classes: int = 0
    free: bool = False

    def __len__(self) -> int:
        return self.n

    def __getitem__(self, i: Any) -> Any:
        with np.load(self.folder / f"{i}.npz") as file:
            keep = np.random.default_rng(i).random(len(file["points"])) < self.share
            X, labels, T = file["points"][keep], file["labels"][keep], file["T"]
        classes = self.classes
        if self.n_classes:
            spread = (X[:, 0] // 2).astype(np.int64) % max(1, self.n_classes // 11)
            labels = np.where(labels < 0, -1, (labels + 11 * spread) % self.n_classes)
        return LabelledCloud(X, classes, labels.astype(np.int32), T_world_sensor=T)

    @property
    def classes(self) -> Classes:
        """The town's, or so many."""
        return (
            Classes(tuple(f"c{k}" for k in range(self.n_classes))) if self.n_classes else SyntheticTown().classes
        )

    @property
    def settings(self) -> Settings:
        """Of a map of these clouds."""
        return Settings(self.classes, OUTDOOR_LIDAR, FreeSpace() if self.free else None)


def save(folder: Path, n: int) -> Saved:
    """Write the town's scans to files."""
    town = SyntheticTown()
    for i in range(n):
        cloud = town.scan(i * STRIDE).observed
        np.savez(folder / f"{i}.npz", points=cloud.points, labels=cloud.hard_labels, T=town.pose(i * STRIDE))
    return Saved(folder, n)


_count = count()


def new_store(folder: Path, settings: Settings) -> MapStore:
    store = MapStore(folder / f"store-{next(_count)}")
    store.create(settings)
    return store
