"""Continuous semantic maps by Gaussian processes: class probabilities and uncertainty at any point."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from semgp.blocks.learning import learn_blocks, learn_from_scans
    from semgp.blocks.model import BlockModel
    from semgp.classes import MISSING, Classes
    from semgp.cloud import LabelledCloud
    from semgp.errors import FileFormatError, InputError, MissingExtraError, SemgpError
    from semgp.gp.model import GPModel
    from semgp.maps.committee import Committee
    from semgp.maps.files import load_map, save_map
    from semgp.maps.forgetting import Forgetting
    from semgp.maps.free_space import FreeSpace
    from semgp.maps.fusion import fuse
    from semgp.maps.gp import GPSemanticMap
    from semgp.maps.learning import learn_model
    from semgp.maps.pooling import fuse_predictions
    from semgp.maps.presets import PRESETS
    from semgp.octomap import SemanticOctoMap
    from semgp.prediction import Prediction
    from semgp.readers import open_scans, read
    from semgp.scene.scan import synthetic_room

__version__ = "0.1.0"

__all__ = [
    "MISSING",
    "PRESETS",
    "BlockModel",
    "Classes",
    "Committee",
    "FileFormatError",
    "Forgetting",
    "FreeSpace",
    "GPModel",
    "GPSemanticMap",
    "InputError",
    "LabelledCloud",
    "MissingExtraError",
    "Prediction",
    "SemanticOctoMap",
    "SemgpError",
    "fuse",
    "fuse_predictions",
    "learn_blocks",
    "learn_from_scans",
    "learn_model",
    "load_map",
    "open_scans",
    "read",
    "save_map",
    "synthetic_room",
]

# Compiled parts are imported when they are first asked for: `semgp --help` does not wait for them.
_HOME = {
    **dict.fromkeys(("MISSING", "Classes"), "semgp.classes"),
    "LabelledCloud": "semgp.cloud",
    **dict.fromkeys(("FileFormatError", "InputError", "MissingExtraError", "SemgpError"), "semgp.errors"),
    "BlockModel": "semgp.blocks.model",
    **dict.fromkeys(("learn_blocks", "learn_from_scans"), "semgp.blocks.learning"),
    "PRESETS": "semgp.maps.presets",
    "GPModel": "semgp.gp.model",
    **dict.fromkeys(("load_map", "save_map"), "semgp.maps.files"),
    "GPSemanticMap": "semgp.maps.gp",
    "FreeSpace": "semgp.maps.free_space",
    "Forgetting": "semgp.maps.forgetting",
    "fuse": "semgp.maps.fusion",
    "Committee": "semgp.maps.committee",
    "fuse_predictions": "semgp.maps.pooling",
    "learn_model": "semgp.maps.learning",
    "SemanticOctoMap": "semgp.octomap",
    "Prediction": "semgp.prediction",
    **dict.fromkeys(("open_scans", "read"), "semgp.readers"),
    "synthetic_room": "semgp.scene.scan",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'semgp' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
