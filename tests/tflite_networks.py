"""Tiny networks in .tflite files: class c is where channel c is brightest."""

from pathlib import Path
from typing import Any, Literal

import ai_edge_litert.schema_py_generated as tflite
import flatbuffers
import numpy as np

GAIN = 8.0
"""Logit c is so many times the input of channel c, from 0 to 1."""

Kind = Literal["float32", "int8", "uint8"]

_TYPES = {
    name: getattr(tflite.TensorType, name.upper()) for name in ("float32", "int8", "uint8", "int32", "int64")
}


def write_tflite(path: Path, kind: Kind, size: int = 8, *, labels: bool = False) -> Path:
    """Write a network of one convolution, quantised unless of floats, and with labels of an arg-max behind it."""
    low = {"float32": 0, "int8": -128, "uint8": 0}[kind]
    one = {"float32": GAIN, "int8": 127, "uint8": 255}[kind]  # what stands for a weight of `GAIN`
    weights = np.zeros((3, 1, 1, 3), kind)
    weights[range(3), 0, 0, range(3)] = one
    image, scores = (1, size, size, 3), (1, size, size, 3)
    bias = np.zeros(3, "float32" if kind == "float32" else "int32")
    graph = _Graph(quantised=kind != "float32")
    graph.tensor("image", kind, image, scale=1 / 255, zero=low)
    graph.tensor("weights", kind, weights.shape, weights, scale=GAIN / one)
    graph.tensor("bias", bias.dtype.name, (3,), bias, scale=GAIN / one / 255)
    graph.tensor("logits", kind, scores, scale=GAIN / 255, zero=low)
    convolution = tflite.Conv2DOptionsT(strideW=1, strideH=1)
    graph.operator(
        tflite.BuiltinOperator.CONV_2D, [0, 1, 2], [3], tflite.BuiltinOptions.Conv2DOptions, convolution
    )
    if labels:
        graph.tensor("axis", "int32", (), np.array(3, np.int32))
        graph.tensor("labels", "int64", scores[:3])
        largest = tflite.ArgMaxOptionsT(outputType=_TYPES["int64"])
        graph.operator(tflite.BuiltinOperator.ARG_MAX, [3, 4], [5], tflite.BuiltinOptions.ArgMaxOptions, largest)
    path.write_bytes(graph.packed(outputs=[5 if labels else 3]))
    return path


class _Graph:
    """A graph in the making."""

    def __init__(self, quantised: bool) -> None:
        self.quantised = quantised
        self.buffers: list[Any] = [tflite.BufferT()]
        self.tensors: list[Any] = []
        self.codes: list[Any] = []
        self.operators: list[Any] = []

    def tensor(
        self,
        name: str,
        kind: str,
        shape: tuple[int, ...],
        content: np.ndarray[Any, Any] | None = None,
        *,
        scale: float | None = None,
        zero: int = 0,
    ) -> None:
        buffer = 0
        if content is not None:
            self.buffers.append(tflite.BufferT(data=list(content.tobytes())))
            buffer = len(self.buffers) - 1
        made = tflite.TensorT(list(shape), _TYPES[kind], buffer, name)
        if self.quantised and scale is not None:
            made.quantization = tflite.QuantizationParametersT(scale=[scale], zeroPoint=[zero])
        self.tensors.append(made)

    def operator(self, code: int, inputs: list[int], outputs: list[int], kind: int, options: Any) -> None:
        self.codes.append(tflite.OperatorCodeT(deprecatedBuiltinCode=code, builtinCode=code, version=1))
        self.operators.append(tflite.OperatorT(len(self.codes) - 1, inputs, outputs, kind, options))

    def packed(self, outputs: list[int]) -> bytes:
        graph = tflite.SubGraphT(self.tensors, [0], outputs, self.operators, "main")
        model = tflite.ModelT(3, self.codes, [graph], "tiny", self.buffers)
        builder = flatbuffers.Builder(1024)
        builder.Finish(model.Pack(builder), file_identifier=b"TFL3")
        return bytes(builder.Output())
