"""What tables and figures call the methods."""

METHOD_NAMES = {
    "gpsm": "GP map",
    "gpsm-averaged": "GP map, averaged rule",
    "octomap": "Semantic OctoMap",
    "csm": "voxel counts",
    "bki": "S-BKI",
    "bki-wide": "S-BKI, wide kernel",
    "knn": "k-NN",
    "knn-all": "k-NN, all labels",
    "1nn-all": "1-NN, all labels",
    "knn-256": "256-NN",
    "labels": "nearest label",
}


def method_name(method: str) -> str:
    """Return what to call a method; one not listed goes by its own name."""
    return METHOD_NAMES.get(method, method)
