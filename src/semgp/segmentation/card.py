"""Model cards: what a network's file does not say about itself, in a small TOML beside it.

`net.toml` goes with `net.onnx` or `net.tflite`. All keys may be left out:

    classes = "ade20k-32"           # a built-in list, a class file beside the card, or a list of names
    layout = "nchw"                 # or "nhwc"; left out, told from where the input has its 3 channels
    size = [512, 512]               # rows and columns of the input, where the model leaves them open
    mean = [0.485, 0.456, 0.406]    # a float input is (value / 255 - mean) / std; left out, 0 and 1
    std = [0.229, 0.224, 0.225]
    output = "logits"               # or "probabilities"; left out, told from whether they sum to one
    logits = "decoder/add"          # the tensor or output that holds them; left out, see the network's file type
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from semgp.class_files import class_list
from semgp.classes import Classes
from semgp.errors import FileFormatError, InputError

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class ModelCard:
    """What is said about a network; the module says what each part means.

    Raises
    ------
    InputError
        Values that make no sense.
    """

    classes: Classes | None = None
    layout: Literal["nhwc", "nchw"] | None = None
    size: tuple[int, int] | None = None
    mean: Triple = (0.0, 0.0, 0.0)
    std: Triple = (1.0, 1.0, 1.0)
    output: Literal["logits", "probabilities"] | None = None
    logits: str | None = None

    def __post_init__(self) -> None:
        if self.layout not in (None, "nhwc", "nchw"):
            raise InputError(f"layout is 'nhwc' or 'nchw', not {self.layout!r}.")
        if self.output not in (None, "logits", "probabilities"):
            raise InputError(f"output is 'logits' or 'probabilities', not {self.output!r}.")
        if self.size is not None and not _are(self.size, int, 2, 1):
            raise InputError(f"size is two whole numbers, rows and columns, not {self.size!r}.")
        if not _are(self.mean, float, 3) or not _are(self.std, float, 3) or min(self.std) <= 0:
            raise InputError(
                f"mean and std are three numbers each, std positive, not {self.mean!r}, {self.std!r}."
            )
        if self.logits is not None and not isinstance(self.logits, str):
            raise InputError(f"logits is the name of a tensor, not {self.logits!r}.")


def read_card(path: Path) -> ModelCard:
    """Return the card beside a model, an empty one where there is none.

    Parameters
    ----------
    path : Path
        The model's file.

    Raises
    ------
    FileFormatError
        A card that is damaged, or has keys or values that make no sense.
    """
    file = path.with_suffix(".toml")
    if not file.is_file():
        return ModelCard()
    try:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
        if unknown := sorted(content.keys() - ModelCard.__dataclass_fields__.keys()):
            raise InputError(
                f"has no key {unknown[0]!r}; the keys are {', '.join(ModelCard.__dataclass_fields__)}."
            )
        return ModelCard(**{key: _value(file, key, content) for key in content})
    except (OSError, ValueError, RecursionError) as error:  # InputError is a ValueError
        raise FileFormatError(file, f"is no model card: {error}") from error


def _value(file: Path, key: str, content: Mapping[str, Any]) -> Any:
    value = content[key]
    if key != "classes":
        return tuple(value) if isinstance(value, list) else value
    if isinstance(value, list):
        return Classes(tuple(value))
    beside = file.parent / str(value)
    return class_list(str(beside) if beside.is_file() else str(value))


def _are(values: Any, kind: type, n: int, least: float = float("-inf")) -> bool:
    """Tell whether values are n numbers of a kind (whole ones are floats, too), each `least` or more."""
    kinds = (int,) if kind is int else (int, float)
    return isinstance(values, tuple) and len(values) == n and all(type(v) in kinds and v >= least for v in values)
