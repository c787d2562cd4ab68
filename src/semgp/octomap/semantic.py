"""The Semantic OctoMap: OctoMap's occupancy, and the average label and colour of each voxel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.protocol import query_points, require_classes
from semgp.maps.settings import stored_setting
from semgp.octomap.bricks import Bricks
from semgp.octomap.files import FREE, OCCUPIED, UNSET, write_bt, write_ot
from semgp.octomap.labels import VoxelLabels
from semgp.octomap.morton import DEPTH, OUTSIDE
from semgp.octomap.occupancy import OccupancyMap
from semgp.octomap.reading import read_tree
from semgp.octomap.sensor import SensorModel, log_odds
from semgp.octomap.tree import Leaves, cells_at, joined, prune
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.upward import Up


class SemanticOctoMap(OccupancyMap):
    """Occupancy exactly as OctoMap keeps it, with class probabilities and a mean colour in each voxel.

    Occupancy and classes are independent (paper, section V): rays make voxels free or occupied, and the labels
    of the points that they reach, hard or soft, are averaged in the points' voxels. Points without a label
    still tell of occupancy and colour.

    Parameters
    ----------
    classes : Classes
        The classes of the map.
    resolution, sensor, max_range, discretize, origin
        See `OccupancyMap`.
    rays : bool, optional
        False for clouds whose sensor pose is not known: voxels become occupied, none becomes free.

    Raises
    ------
    InputError
        Settings that `OccupancyMap` refuses.
    """

    kind = "octomap"
    up: Up = "z"

    def __init__(
        self,
        classes: Classes,
        resolution: float = 0.02,
        *,
        sensor: SensorModel | None = None,
        max_range: float | None = None,
        discretize: bool = False,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        rays: bool = True,
    ) -> None:
        super().__init__(resolution, sensor=sensor, max_range=max_range, discretize=discretize, origin=origin)
        self.classes = classes
        self.rays = bool(rays)
        self._labels = VoxelLabels()

    def update(self, cloud: LabelledCloud) -> None:
        """Take in a cloud; an empty one changes nothing.

        Raises
        ------
        InputError
            Classes that differ from the map's, a cloud without sensor pose, or points or a sensor beyond the
            reach of the map. The map is then as before.
        """
        require_classes(cloud, self.classes)
        if self.rays and cloud.origin is None:
            raise InputError(
                "the cloud has no T_world_sensor, and rays begin at the sensor: give its pose, or make the map "
                "with rays=False, which marks the points' voxels as occupied and none as free."
            )
        codes = self.insert(cloud.points, cloud.origin if self.rays else None)
        reached = codes != OUTSIDE
        if not reached.all():
            codes, cloud = codes[reached], cloud[reached]
        self._labels.add(codes, cloud)

    def query(self, points: ArrayLike) -> Prediction:
        """Answer at points (M, 3), metres, world frame, with the average label of their voxels.

        A point is observed if its voxel has labels; else it gets the uniform distribution. Where no ray has told
        whether something is there, the occupancy is 1/2.

        Raises
        ------
        InputError
            Points that are not (M, 3) and finite, or a map without labels.
        """
        X = query_points(points)
        if self._labels.n_labelled == 0:
            raise InputError("the map has no labels yet: update it with a labelled cloud first.")
        probability, observed = self._labels.probability(self._codes(X), len(self.classes))
        return Prediction(self.classes, probability, observed, occupancy=self.occupancy(X))

    def occupancy(self, points: ArrayLike) -> OccupancyPrediction:
        """Return whether something is there, at points (M, 3), metres, world frame; 1/2 where not known.

        Raises
        ------
        InputError
            Points that are not (M, 3) and finite.
        """
        found = self.query_occupancy(points)
        return OccupancyPrediction(found.probability, found.known)

    def query_colours(self, points: ArrayLike) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        """Return the mean colour (M, 3) at points (M, 3), and where there is one (M,); elsewhere it is 0."""
        return self._labels.mean_colour(self._codes(query_points(points)))

    @property
    def positions(self) -> NDArray[np.float64]:
        """Centres (n, 3) of the voxels that have labels, metres, world frame."""
        codes = self._labels.labelled_codes
        return self._cells(Leaves(codes, np.full(len(codes), DEPTH), np.zeros(len(codes)))).centres

    @property
    def occupied_positions(self) -> NDArray[np.float64]:
        """Centres (n, 3) of the occupied voxels, metres, world frame."""
        return self.occupied(pruned=False).centres

    @property
    def free_positions(self) -> NDArray[np.float64]:
        """Centres (n, 3) of the free voxels, metres, world frame."""
        return self.free(pruned=False).centres

    def prune(self) -> None:
        """Give spare memory back; see `OccupancyMap.prune`."""
        super().prune()
        self._labels.trim()

    def info(self) -> dict[str, Any]:
        """Return settings, counts and memory figures."""
        return {
            "kind": self.kind,
            **self._settings(),
            "classes": len(self.classes),
            "voxels": len(self),
            "labelled_voxels": self._labels.n_labelled,
            "occupancy_bytes": self._bricks.n_bytes,
            "label_bytes": self._labels.n_bytes,
            "memory_bytes": self._bricks.n_bytes + self._labels.n_bytes,
        }

    def write(self, path: str | Path, colours: Literal["mean", "class"] | None = None) -> None:
        """Write the map for OctoMap and octovis, in the map's own coordinates.

        Parameters
        ----------
        path : str or Path
            `*.bt` for a file that says occupied or free; `*.ot` for one that keeps log-odds.
        colours : {"mean", "class"}, optional
            Give the occupied voxels of a `.ot` file their mean colour, or that of their most probable class. It
            is then a ColorOcTree, in which occupied voxels stay apart; else it is a pruned OcTree.

        Raises
        ------
        InputError
            Another suffix, colours for a `.bt` file, or another kind of colours.
        """
        path = Path(path)
        if path.suffix == ".bt" and colours is None:
            write_bt(path, self._leaves_free_or_occupied(), self.resolution)
        elif path.suffix == ".ot" and colours is None:
            write_ot(path, self._leaves(), self.resolution)
        elif path.suffix == ".ot" and colours in ("mean", "class"):
            leaves = self._leaves_with_voxels_apart()
            write_ot(path, leaves, self.resolution, self._leaf_colours(leaves, colours))
        else:
            raise InputError(
                f"cannot write {path} with colours {colours!r}: OctoMap's files are *.bt, without colours, and "
                "*.ot, without or with 'mean' or 'class' colours."
            )

    @classmethod
    def read(cls, path: str | Path, classes: Classes, **settings: Any) -> Self:
        """Read a `.bt` or `.ot` file of OctoMap: occupancy, and the colours of occupied leaves.

        Such a file has no labels; `to_arrays` keeps everything.

        Parameters
        ----------
        path : str or Path
            The file; its first line, not its name, tells which it is.
        classes : Classes
            The classes of clouds to come.
        **settings
            As for the map itself; the resolution is the file's.

        Raises
        ------
        FileFormatError
            A file that is neither, is damaged, or holds another kind of tree than OcTree and ColorOcTree.
        """
        sensor = settings.get("sensor") or SensorModel()
        resolution, leaves, colours = read_tree(Path(path), log_odds(sensor.clamp_min), log_odds(sensor.clamp_max))
        made = cls(classes, resolution, **settings)
        made._bricks = Bricks.from_leaves(leaves)
        coloured = sensor.occupied(leaves.state) & (colours != UNSET).any(axis=1)
        codes, values = cells_at(Leaves(leaves.first, leaves.depth, np.arange(len(leaves)))[coloured], DEPTH)
        made._labels.add_colours(codes, colours[values])
        return made

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return a header and arrays from which `from_arrays` makes the same map."""
        return self._settings(), {**self._bricks.to_arrays(), **self._labels.to_arrays()}

    @classmethod
    def from_arrays(cls, classes: Classes, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the map again from what `to_arrays` gave.

        Raises
        ------
        InputError
            Entries that are missing or damaged.
        """
        names = ("resolution", "max_range", "discretize", "origin", "rays")
        settings = {name: stored_setting(header, name) for name in names}
        stored = stored_setting(header, "sensor")
        sensor = SensorModel(**{field.name: stored_setting(stored, field.name) for field in fields(SensorModel)})
        made = cls(classes, sensor=sensor, **settings)
        made._bricks = Bricks.from_arrays(arrays)
        made._labels = VoxelLabels.from_arrays(len(classes), arrays)
        return made

    def _settings(self) -> dict[str, Any]:
        return {
            "resolution": self.resolution,
            "sensor": asdict(self.sensor),
            "max_range": self.max_range,
            "discretize": self.discretize,
            "origin": self.origin.tolist(),
            "rays": self.rays,
        }

    def _leaves_free_or_occupied(self) -> Leaves:
        """Return leaves pruned by whether they are occupied, not by their log-odds (`toMaxLikelihood`)."""
        return prune(
            *(
                (codes, np.where(self.sensor.occupied(values), OCCUPIED, FREE))
                for codes, values in (self._bricks.voxels(of_solid=False), self._bricks.solid())
            )
        )

    def _leaves_with_voxels_apart(self) -> Leaves:
        """Return the pruned leaves where free, and voxels where occupied."""
        leaves = self._leaves()
        occupied = self.sensor.occupied(leaves.state)
        codes, values = cells_at(leaves[occupied], DEPTH)
        return joined(leaves[~occupied], Leaves(codes, np.full(len(codes), DEPTH), values))

    def _leaf_colours(self, leaves: Leaves, colours: str) -> NDArray[np.uint8]:
        """Return the colour (L, 3) of each leaf that is an occupied voxel; `UNSET` for the others."""
        found = np.full((len(leaves), 3), UNSET, dtype=np.uint8)
        if colours == "mean":
            some, known = self._labels.mean_colour(leaves.first)
        else:
            top = self._labels.top_class(leaves.first)
            some, known = self.classes.palette[top], top != MISSING
        known &= self.sensor.occupied(leaves.state)
        found[known] = some[known]
        return found
