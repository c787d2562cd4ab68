"""Networks in .onnx files, by onnxruntime (extra `segment`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.segmentation.protocol import Answer


class ONNXNetwork:
    """A network in an .onnx file.

    The first output of whole numbers are labels, (1, h, w) with or without an axis of one channel; the first
    output of floats, or the one that `logits` names, are scores.

    Parameters
    ----------
    path : Path
        The file.
    logits : str, optional
        Name of the output with the scores.

    Raises
    ------
    MissingExtraError
        Without the extra `segment`.
    FileFormatError
        A file that is missing or damaged, or has no such outputs.
    """

    def __init__(self, path: Path, logits: str | None = None) -> None:
        try:
            import onnxruntime
        except ImportError as error:
            raise MissingExtraError("running an .onnx network", "segment") from error
        try:
            content = path.read_bytes()
            self._session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
        except OSError as error:
            raise FileFormatError(path, f"cannot be read: {error.strerror or error}.") from error
        except Exception as error:  # onnxruntime's own errors have no common base
            raise FileFormatError(path, f"is no .onnx network, or is damaged: {error}") from error
        self._input = self._session.get_inputs()[0]
        outputs = self._session.get_outputs()
        self._labels = next((o for o in outputs if "int" in o.type), None)
        self._scores = next((o for o in outputs if (o.name == logits if logits else _is_float(o.type))), None)
        if logits is not None and self._scores is None:
            raise FileFormatError(
                path, f"has no output {logits!r}, but {', '.join(o.name for o in outputs)}: change its model card."
            )
        if self._labels is None and self._scores is None:
            raise FileFormatError(path, "has no output of labels or scores.")

    @property
    def input_shape(self) -> tuple[int | None, ...]:
        """The sizes of the input; None where any will do."""
        return _sizes(self._input.shape)

    @property
    def input_type(self) -> np.dtype[Any]:
        """Type of the input."""
        name = self._input.type.removeprefix("tensor(").removesuffix(")")
        return np.dtype({"float": "f4", "double": "f8"}.get(name, name if name[0] in "uif" else "V"))

    @property
    def scores_shape(self) -> tuple[int | None, ...] | None:
        """Sizes of the scores of a batch; None where it puts out labels only."""
        return None if self._scores is None else _sizes(self._scores.shape)

    def run(self, batch: NDArray[Any]) -> Answer:
        """Return the answer to a batch of one image."""
        wanted = [output.name for output in (self._labels, self._scores) if output is not None]
        try:
            arrays = dict(zip(wanted, self._session.run(wanted, {self._input.name: batch})))
        except Exception as error:  # as above
            raise InputError(f"the network does not take a batch of shape {batch.shape}: {error}") from error
        labels = None if self._labels is None else np.asarray(arrays[self._labels.name])
        scores = None if self._scores is None else np.asarray(arrays[self._scores.name][0], dtype=np.float32)
        return Answer(None if labels is None else labels.reshape(_image_shape(labels.shape)), scores)


def _sizes(shape: list[Any]) -> tuple[int | None, ...]:
    """Return the sizes of a tensor; those that the file leaves open have names."""
    return tuple(size if isinstance(size, int) else None for size in shape)


def _is_float(kind: str) -> bool:
    return "float" in kind or "double" in kind


def _image_shape(shape: tuple[int, ...]) -> tuple[int, int]:
    """Return rows and columns of a batch of one label image."""
    rows, columns = (
        [size for size in shape if size != 1][-2:] if sum(size != 1 for size in shape) >= 2 else shape[-2:]
    )
    return rows, columns
