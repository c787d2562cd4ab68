"""Write point files: PLY and PCD for viewers, LAS for surveyors, npz for semgp. A file is whole or not there."""

from semgp.writers.atomic import atomic_write
from semgp.writers.columns import LARGEST_ROUNDING, Columns, coordinates, structured
from semgp.writers.las import write_las
from semgp.writers.npz import write_npz
from semgp.writers.pcd import write_pcd
from semgp.writers.ply import ply_header, write_ply
from semgp.writers.text import write_csv

__all__ = [
    "LARGEST_ROUNDING",
    "Columns",
    "atomic_write",
    "coordinates",
    "ply_header",
    "structured",
    "write_csv",
    "write_las",
    "write_npz",
    "write_pcd",
    "write_ply",
]
