"""What planners ask, once more, in plain loops over single points."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from semgp.maps.protocol import SpatialMap

F64 = NDArray[np.float64]
Place = tuple[int, ...]


def first_surface(semantic_map: SpatialMap, o: F64, d: F64, max_range: float, threshold: float) -> float:
    """March through the whole ray in steps of half a voxel, then halve the step three times."""

    def occupied(t: F64) -> NDArray[np.bool_]:
        answer = semantic_map.query(o + t[:, None] * d).occupancy
        assert answer is not None
        return answer.known & (answer.probability >= threshold)

    step = semantic_map.resolution / 2
    t = np.minimum(np.arange(math.ceil(max_range / step - 1e-9) + 1) * step, max_range)
    hit = occupied(t)
    if not hit.any():
        return math.inf
    k = int(hit.argmax())
    before, after = t[max(k - 1, 0)], t[k]
    for _ in range(3):
        middle = (before + after) / 2
        if occupied(np.array([middle]))[0]:
            after = middle
        else:
            before = middle
    return float(after)


def unknown_length(semantic_map: SpatialMap, o: F64, d: F64, end: float) -> float:
    piece, total, begin = 2 * semantic_map.resolution, 0.0, 0.0
    while begin < end:
        length = min(piece, end - begin)
        answer = semantic_map.query((o + (begin + length / 2) * d)[None]).occupancy
        assert answer is not None
        total += 0.0 if answer.known[0] else length
        begin += piece
    return total


def channel_information(prior: F64, channel: F64) -> float:
    """Mutual information of input and output, from their joint distribution; channel[x, y] = P(y | x)."""
    total = 0.0
    output = prior @ channel
    for x, y in product(*map(range, channel.shape)):
        joint = prior[x] * channel[x, y]
        if joint > 0:
            total += joint * math.log(joint / (prior[x] * output[y]))
    return total


def symmetric_channel(n: int, error: float) -> F64:
    return np.array([[1 - error if x == y else error / (n - 1) for y in range(n)] for x in range(n)])


def gain(
    semantic_map: SpatialMap,
    T: F64,
    directions: F64,
    max_range: float,
    spacing: float,
    errors: tuple[float, float],
    hardly: float,
) -> tuple[float, float]:
    """Information of one view about occupancy and classes: each voxel once, with its greatest reach."""
    n_classes = len(semantic_map.classes)
    greatest: dict[Place, float] = {}
    told: dict[Place, tuple[float, float]] = {}
    for direction in directions:
        d = T[:3, :3] @ (direction / np.linalg.norm(direction))
        reach = 1.0
        for j in range(math.ceil(max_range / spacing - 1e-9)):
            x, y, z = np.floor((T[:3, 3] + (j + 0.5) * spacing * d) / spacing).astype(int)
            voxel: Place = (int(x), int(y), int(z))
            prediction = semantic_map.query((np.array([voxel]) + 0.5) * spacing)
            assert prediction.occupancy is not None
            p = float(prediction.occupancy.probability[0]) if prediction.occupancy.known[0] else 0.5
            if reach < hardly:
                break
            greatest[voxel] = max(greatest.get(voxel, 0.0), reach)
            told[voxel] = (
                channel_information(np.array([1 - p, p]), symmetric_channel(2, errors[0])),
                p * channel_information(prediction.probability[0], symmetric_channel(n_classes, errors[1])),
            )
            reach *= 1 - p
    return (
        sum(greatest[voxel] * told[voxel][0] for voxel in greatest),
        sum(greatest[voxel] * told[voxel][1] for voxel in greatest),
    )


def state(semantic_map: SpatialMap, x: float, y: float, z: float) -> tuple[int, float, int]:
    """Return -1 for unknown, 0 for free, 1 for occupied; the probability; and the label."""
    prediction = semantic_map.query(np.array([[x, y, z]]))
    assert prediction.occupancy is not None
    p = float(prediction.occupancy.probability[0])
    return -1 if not prediction.occupancy.known[0] else int(p >= 0.5), p, int(prediction.label[0])


def frontier_clusters(semantic_map: SpatialMap, low: F64, shape: Place, edge: float) -> list[set[Place]]:
    """Free cells with an unknown neighbour, and which of them hang together, by flood fill."""
    cells = set(product(*map(range, shape)))
    states = {c: state(semantic_map, *(float(v) for v in low + (np.array(c) + 0.5) * edge))[0] for c in cells}
    faces = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    left = {c for c in cells if states[c] == 0 and any(states.get(_plus(c, step)) == -1 for step in faces)}
    clusters = []
    while left:
        cluster, edge_of_it = set(), [left.pop()]
        while edge_of_it:
            cell = edge_of_it.pop()
            cluster.add(cell)
            beside = {_plus(cell, step) for step in product((-1, 0, 1), repeat=3)} & left
            left -= beside
            edge_of_it += beside
        clusters.append(cluster)
    return sorted(clusters, key=len, reverse=True)


def _plus(a: Place, b: Place) -> Place:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def grid_cell(
    semantic_map: SpatialMap, x: float, y: float, heights: list[float], costs: dict[str, int]
) -> tuple[int, int, int]:
    """Percent, label and cost of one column."""
    percent, label, cost = -1, -1, -1
    for z in heights:
        what, p, its_label = state(semantic_map, x, y, float(z))
        if what >= 0:
            percent = max(percent, round(100 * p))
            cost = max(cost, 0)
        if what == 1:
            label = its_label
            name = None if label < 0 else semantic_map.classes.names[label]
            cost = max(cost, 100 if name is None else costs.get(name, 100))
    return percent, label, cost
