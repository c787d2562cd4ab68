"""Tiny networks in .onnx files: class c is where channel c is brightest."""

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper

GAIN = 8.0
"""Logit c is so many times the input of channel c."""


def write_onnx(
    path: Path,
    *,
    n_classes: int = 3,
    size: tuple[int, int] | tuple[str, str] = (8, 8),
    stride: int = 1,
    nhwc: bool = False,
    kind: int = TensorProto.FLOAT,
    outputs: tuple[str, ...] = ("logits",),
    batch: int = 1,
    gate: int | None = None,
) -> Path:
    """Write a network that multiplies the first channels by `GAIN`, every stride-th pixel of every stride-th row.

    Its outputs are some of logits, probabilities, labels and labels4 (with an axis for the one channel). A gate
    lets only images of so many columns through, without saying so.
    """
    weights = np.zeros((n_classes, 3, 1, 1), np.float32)
    for c in range(min(n_classes, 3)):
        weights[c, c] = GAIN
    image = [batch, *size, 3] if nhwc else [batch, 3, *size]
    nodes = [helper.make_node("Cast", ["image"], ["pixels"], to=TensorProto.FLOAT)]
    last = "pixels"
    if nhwc:
        nodes.append(helper.make_node("Transpose", [last], ["planes"], perm=[0, 3, 1, 2]))
        last = "planes"
    if gate is not None:
        nodes.append(helper.make_node("Reshape", [last, "gate"], ["through"]))
        last = "through"
    nodes.append(helper.make_node("Conv", [last, "w"], ["nchw"], strides=[stride, stride]))
    perm = [0, 2, 3, 1] if nhwc else [0, 1, 2, 3]
    axis = 3 if nhwc else 1
    nodes.append(helper.make_node("Transpose", ["nchw"], ["logits"], perm=perm))
    nodes.append(helper.make_node("Softmax", ["logits"], ["probabilities"], axis=axis))
    nodes.append(helper.make_node("ArgMax", ["logits"], ["labels"], axis=axis, keepdims=0))
    nodes.append(helper.make_node("ArgMax", ["logits"], ["labels4"], axis=axis, keepdims=1))
    coarse: list[Any] = [size[0] // stride, size[1] // stride] if isinstance(size[0], int) else ["h", "w"]
    shapes = {
        **dict.fromkeys(
            ("logits", "probabilities"), [batch, *coarse, n_classes] if nhwc else [batch, n_classes, *coarse]
        ),
        "labels": [batch, *coarse],
        "labels4": [batch, *coarse, 1] if nhwc else [batch, 1, *coarse],
    }
    infos = [
        helper.make_tensor_value_info(
            name, TensorProto.INT64 if "label" in name else TensorProto.FLOAT, shapes[name]
        )
        for name in outputs
    ]
    constants = [helper.make_tensor("w", TensorProto.FLOAT, weights.shape, weights.ravel().tolist())]
    if gate is not None:
        constants.append(helper.make_tensor("gate", TensorProto.INT64, [4], [1, 3, -1, gate]))
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("image", kind, image)],
        infos,
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path


def blocks_image(size: int = 8) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Return an image whose quarters are red, green, blue and red."""
    half = size // 2
    image = np.zeros((size, size, 3), np.uint8)
    image[:half, :half, 0] = image[:half, half:, 1] = image[half:, :half, 2] = image[half:, half:, 0] = 200
    return image


QUARTERS = np.kron(np.array([[0, 1], [2, 0]]), np.ones((4, 4), int))
"""The labels of `blocks_image`."""
