"""The surfaces of a map as triangle meshes, at any resolution and for any class, from scans of one room.

    uv run examples/09_surfaces.py --out surfaces.png

A depth camera goes once around a furnished room: noisy points, one in nine with a label, some of those wrong, and
one lamp that no view labels. The mesh is as fine as the lattice on which the map is asked; the map stays the same.

Above: the surface on which something is there with probability 1/2, in the colours of the most probable classes,
seen through the near walls and without the ceiling. Below: how unsure the map is of the class that it shows, most
of all of the lamp without labels, and where furniture hid the floor; and one class alone, the surface on which a
chair is there with probability 1/2. The finer mesh of the room is written beside the picture, as a PLY file with
labels and uncertainty at its vertices.
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from semgp import PRESETS, GPSemanticMap, LabelledCloud, synthetic_room
from semgp.maps.free_space import FreeSpace
from semgp.picture import View, by_value, colour_bar, legend, panels, save_png, splat, stack
from semgp.scene import DepthCamera
from semgp.surfaces import Mesh, surface, write_mesh

LOW, HIGH = (-3.0, -2.5, -0.5), (3.0, 2.5, 2.45)  # metres: the room without its ceiling
LAMP = np.array([-0.5, -0.3, 0.8])  # direction to the light
SIZE = (1000, 640)  # pixels of each picture


def drawn(mesh: Mesh, colours: NDArray[np.uint8], view: View, spacing: float) -> NDArray[np.uint8]:
    """Return a picture of the front faces of a mesh: of points on them, so many metres apart."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    rng = np.random.default_rng(0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    corners = np.repeat(mesh.faces, rng.poisson(areas / spacing**2), axis=0)
    share = rng.dirichlet((1, 1, 1), len(corners))
    points = np.einsum("nk,nkd->nd", share, mesh.vertices[corners])
    nearest = corners[np.arange(len(corners)), share.argmax(axis=1)]
    normals = mesh.normals[nearest]
    light = 0.62 + 0.45 * np.maximum(normals @ LAMP / np.linalg.norm(LAMP), 0)
    paint = np.minimum(colours[nearest] * light[:, None], 255).astype(np.uint8)
    front = ((view.T_world_camera[:3, 3] - points) * normals).sum(axis=1) > 0
    return splat(points[front], paint[front], view, size=1.3 * spacing, shading=0.5)


def report(name: str, mesh: Mesh, truth: LabelledCloud) -> None:
    """Print how large a mesh is, and how near and how right its vertices are, by the nearest true points."""
    distance, nearest = cKDTree(truth.points).query(mesh.vertices, workers=-1)
    right = (truth.hard_labels[nearest] == mesh.label).mean()
    print(
        f"{name:24} {len(mesh.faces):7,} triangles, {mesh.area:5.1f} m2, "
        f"median distance {1000 * np.median(distance):2.0f} mm, labels right {right:.1%}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("surfaces.png"))
    out = parser.parse_args().out

    room = synthetic_room(seed=0, camera=DepthCamera(width=240, height=180))
    scans = [room.scan(i) for i in range(room.views)]
    room_map = GPSemanticMap(room.classes, PRESETS["general"], free=FreeSpace())
    for scan in scans:
        room_map.update(scan.observed)

    coarse = surface(room_map, resolution=0.1, low=LOW, high=HIGH)
    fine = surface(room_map, resolution=0.04, low=LOW, high=HIGH)
    of_chairs = fine.vertices[fine.label == room.classes.index("chair")]
    low, high = np.quantile(of_chairs, (0.01, 0.99), axis=0)
    chairs = surface(room_map, "chair", resolution=0.02, low=low - 0.15, high=high + 0.15)

    truth = LabelledCloud(
        np.vstack([scan.truth.points for scan in scans]),
        room.classes,
        np.concatenate([scan.truth.hard_labels for scan in scans]),
    )
    for name, mesh in (("every 10 cm", coarse), ("every 4 cm", fine), ("chairs, every 2 cm", chairs)):
        report(name, mesh, truth)
    write_mesh(out.with_suffix(".ply"), fine)

    width, height = SIZE
    whole = View.look_at((-0.7, -6.1, 5.9), (0.15, 0.0, 0.7), fov=37, width=width, height=height)
    close = View.look_at((-1.9, -3.4, 2.6), chairs.vertices.mean(axis=0), fov=29, width=width, height=height)
    assert fine.variance is not None
    deviation = np.sqrt(fine.variance)
    least, most = np.quantile(deviation, (0.01, 0.99))
    pictures = [
        drawn(coarse, coarse.colours, whole, 0.01),
        drawn(fine, fine.colours, whole, 0.01),
        drawn(fine, by_value(deviation, least, most), whole, 0.01),
        drawn(chairs, chairs.colours, close, 0.004),
    ]
    titles = ("asked every 10 cm", "asked every 4 cm", "latent deviation", 'the class "chair" alone, every 2 cm')
    grid = panels(pictures, titles, columns=2, font_size=28)
    bar = colour_bar(least, most, "latent deviation of the class shown", width=width, font_size=28)
    save_png(out, stack([grid, legend(room.classes, grid.shape[1], font_size=28), bar]))
    print(f"{out}, {out.with_suffix('.ply')}")


if __name__ == "__main__":
    main()
