"""PLY files written by hand."""

from pathlib import Path


def ply(path: Path, header: str, body: bytes = b"") -> Path:
    path.write_bytes(header.encode() + body)
    return path


def ascii_ply(path: Path, properties: str, rows: str, count: int | None = None) -> Path:
    """Write an ASCII PLY file; `properties` is a list such as "float x, uchar label"."""
    lines = [f"property {p.strip()}" for p in properties.split(",")]
    n = len(rows.splitlines()) if count is None else count
    header = "\n".join(["ply", "format ascii 1.0", f"element vertex {n}", *lines, "end_header", ""])
    return ply(path, header, rows.encode())


XYZ = "float x, float y, float z"
