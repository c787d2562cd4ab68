"""Media types of the service's bodies."""

NPY = "application/x-npy"
"""One array, numpy's .npy."""

NPZ = "application/x-npz"
"""Named arrays, numpy's .npz."""

RAW = "application/octet-stream"
"""Rows of numbers, little-endian, nothing else."""

JSON = "application/json"

VERSION = "X-Semgp-Version"
"""The header that says which version of the map has answered."""

COLUMNS = "X-Semgp-Columns"
"""The header that says what the columns of raw rows are."""
