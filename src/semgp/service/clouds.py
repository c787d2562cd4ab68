"""Bodies of updates: labelled clouds as .npz files of the layout of `semgp.readers.npz`."""

from __future__ import annotations

import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.readers.npz import DAMAGE, read_npz
from semgp.writers import write_npz

_PIECE = 1 << 20


def encode_cloud(cloud: LabelledCloud) -> bytes:
    """Return a cloud as the body of an update."""
    with TemporaryDirectory(prefix="semgp-") as folder:
        path = Path(folder) / "cloud.npz"
        write_npz(path, cloud)
        return path.read_bytes()


def decode_cloud(body: bytes, classes: Classes, most_unpacked: int) -> LabelledCloud:
    """Return the cloud that a body holds.

    Parameters
    ----------
    body : bytes
        An .npz file.
    classes : Classes
        Of the labels, where the file does not name them.
    most_unpacked : int
        Bytes of all its arrays.

    Raises
    ------
    InputError
        A body that is damaged, unpacks to more, or holds no cloud.
    """
    with TemporaryDirectory(prefix="semgp-") as folder:
        path = Path(folder) / "cloud.npz"
        path.write_bytes(body)
        try:
            _refuse_bombs(path, most_unpacked)
            cloud = read_npz(path)
            return read_npz(path, classes=classes) if cloud.classes.nameless else cloud
        except FileFormatError as error:
            raise InputError(f"the body {str(error).removeprefix(f'{path}: ')}") from error
        except (*DAMAGE, MemoryError, Warning) as error:  # a hostile header may be nested too deep for Python
            if isinstance(error, InputError):
                raise
            raise InputError(f"the body is no npz file, or is damaged: {error}") from error


def _refuse_bombs(path: Path, most: int) -> None:
    """Raise InputError for an archive of too much, which may lie about it: read in pieces, nothing is kept."""
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        if any(member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for member in members):
            raise InputError("the body is compressed in an unusual way: np.savez_compressed writes what is read.")
        if sum(member.file_size for member in members) > most:
            raise InputError(f"the body's arrays have more than {most:,} bytes: send parts of the cloud.")
        for member in members:
            with archive.open(member) as file:
                while file.read(_PIECE):  # fails where there is more than is claimed
                    pass
