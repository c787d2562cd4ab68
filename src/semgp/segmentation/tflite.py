"""Networks in .tflite files, by ai-edge-litert (extra `segment`)."""

from __future__ import annotations

import threading
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import FileFormatError, MissingExtraError
from semgp.parallel import n_workers
from semgp.segmentation.protocol import Answer

Details = dict[str, Any]


class TFLiteNetwork:
    """A network in a .tflite file.

    An output of whole numbers (1, h, w) are labels. Their logits are then read from within the network: from the
    tensor that `logits` names, or from the one that the arg-max is taken of, the last of its size before it; and
    if the network has only enlarged that from the tensor before it (same channels, same quantisation, fewer
    pixels), from the smaller one. Any other output are scores, quantised or not.

    Parameters
    ----------
    path : Path
        The file.
    logits : str, optional
        Name of the tensor with the logits.

    Raises
    ------
    MissingExtraError
        Without the extra `segment`.
    FileFormatError
        A file that is missing or damaged, or has no tensor of that name.
    """

    def __init__(self, path: Path, logits: str | None = None) -> None:
        self._interpreter = _open(path, preserve=False)
        output = self._interpreter.get_output_details()[0]
        self._labels = output if _is_label_image(output) else None
        self._scores: Details | None = output
        self._enlarged: Details | None = None
        if self._labels is not None or logits is not None:
            self._interpreter = _open(path, preserve=True)
            tensors = self._interpreter.get_tensor_details()
            self._scores, self._enlarged = logits_of(path, tensors, output["index"], logits)
        self._input = self._interpreter.get_input_details()[0]
        self._lock = threading.Lock()

    @property
    def input_shape(self) -> tuple[int | None, ...]:
        """The four sizes of the input."""
        return tuple(self._input["shape"].tolist())

    @property
    def input_type(self) -> np.dtype[Any]:
        """Type of the input."""
        kind: np.dtype[Any] = np.dtype(self._input["dtype"])
        return kind

    @property
    def scores_shape(self) -> tuple[int | None, ...] | None:
        """Sizes of the scores of a batch; None where it puts out labels only."""
        return None if self._scores is None else tuple(self._scores["shape"].tolist())

    def run(self, batch: NDArray[Any]) -> Answer:
        """Return the answer to a batch of one image."""
        with self._lock:
            self._interpreter.set_tensor(self._input["index"], batch)
            self._interpreter.invoke()
            labels, raw, enlarged = map(self._tensor, (self._labels, self._scores, self._enlarged))
        if raw is None or self._scores is None:
            return Answer(None if labels is None else labels.reshape(labels.shape[:2]))
        scale, zero = self._scores["quantization"]
        scores = ((raw.astype(np.float32) - zero) * scale if scale else raw).astype(np.float32)
        return Answer(
            None if labels is None else labels.reshape(labels.shape[:2]),
            scores,
            tolerance=1e-3 + scale / 2 * raw.shape[-1],
            corners=enlarged is not None and enlarged_by_corners(raw, enlarged),
        )

    def _tensor(self, details: Details | None) -> NDArray[Any] | None:
        return None if details is None else np.array(self._interpreter.get_tensor(details["index"])[0])


def _open(path: Path, preserve: bool) -> Any:
    """Return the interpreter of a file, ready to run."""
    try:
        from ai_edge_litert.interpreter import Interpreter
    except ImportError as error:
        raise MissingExtraError("running a .tflite network", "segment") from error
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*experimental_preserve_all_tensors")  # memory: 50 MB or so
            interpreter = Interpreter(
                str(path), experimental_preserve_all_tensors=preserve, num_threads=n_workers()
            )
        interpreter.allocate_tensors()
    except (ValueError, RuntimeError, OSError) as error:
        raise FileFormatError(path, f"is no .tflite network, or is damaged: {error}") from error
    return interpreter


def logits_of(
    path: Path, tensors: list[Details], output: int, name: str | None
) -> tuple[Details | None, Details | None]:
    """Return the logits of a name, or those before an arg-max; and their enlargement, where there is one."""
    if name is None:
        last = [tensor["index"] for tensor in tensors].index(output)
        i = next((k for k in range(last - 1, -1, -1) if _is_score_image(tensors[k], tensors[last])), -1)
        if i > 0 and _enlarges(tensors[i], tensors[i - 1]):
            i -= 1
    else:
        i = next((i for i, tensor in enumerate(tensors) if tensor["name"] == name), -1)
        if i < 0:
            raise FileFormatError(path, f"has no tensor {name!r}; its model card names another as logits.")
    if i < 0 or len(tensors[i]["shape"]) != 4:
        return None, None
    larger = tensors[i + 1 : i + 2]
    return tensors[i], larger[0] if larger and _enlarges(larger[0], tensors[i]) else None


def _is_score_image(tensor: Details, labels: Details) -> bool:
    """Tell whether a tensor may be what the labels (1, h, w) were taken from: (1, h, w, C)."""
    return len(tensor["shape"]) == 4 and bool((tensor["shape"][:3] == labels["shape"][:3]).all())


def _enlarges(large: Details, small: Details) -> bool:
    """Tell whether one tensor is another enlarged: same channels, same quantisation, more pixels."""
    return (
        len(small["shape"]) == len(large["shape"]) == 4
        and small["shape"][3] == large["shape"][3]
        and small["quantization"] == large["quantization"]
        and bool((small["shape"][1:3] < large["shape"][1:3]).all())
    )


def enlarged_by_corners(small: NDArray[Any], large: NDArray[Any]) -> bool:
    """Tell whether a grid was enlarged by corners: then every so many-th value is one of its own."""
    rows, columns = (large.shape[axis] // small.shape[axis] for axis in (0, 1))
    picked = large[::rows, ::columns]
    return picked.shape == small.shape and bool(np.allclose(picked, small, rtol=1e-3))


def _is_label_image(output: Details) -> bool:
    shape = output["shape"]
    whole = np.issubdtype(output["dtype"], np.integer)
    return bool(whole and (len(shape) == 3 or (len(shape) == 4 and shape[3] == 1)))
