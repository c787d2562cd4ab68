"""The kinds of map, by the name that files and the command line use."""

from semgp.baselines.bki import BKIMap
from semgp.baselines.csm import CSMMap
from semgp.baselines.knn import KNNMap
from semgp.maps.gp import GPSemanticMap
from semgp.maps.protocol import SerialisableMap
from semgp.octomap import SemanticOctoMap

MAP_KINDS: dict[str, type[SerialisableMap]] = {
    "gp": GPSemanticMap,
    "octomap": SemanticOctoMap,
    "knn": KNNMap,
    "csm": CSMMap,
    "bki": BKIMap,
}
"""Each kind's class; a new map needs its row here, and one in tests/conformance."""
