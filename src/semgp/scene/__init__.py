"""A synthetic scene: a furnished room, ray-cast, with a noisy sensor and faulty labels."""

from semgp.scene.labels import LabelFaults
from semgp.scene.scan import SyntheticRoom, SyntheticScan, synthetic_room
from semgp.scene.sensor import DepthCamera

__all__ = ["DepthCamera", "LabelFaults", "SyntheticRoom", "SyntheticScan", "synthetic_room"]
