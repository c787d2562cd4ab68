"""What the OpenAPI schema says of bodies, which FastAPI cannot know."""

from __future__ import annotations

from typing import Any

from semgp.service.formats import COLUMNS, JSON, NPY, NPZ, RAW, VERSION

ABOUT = (
    "Class probabilities and uncertainty of a semantic map, at any point.\n\n"
    'Every error is {"error": "what is wrong, and what to do"}: 4xx where the request is at fault, 503 with '
    "Retry-After where it may be sent again."
)


def _binary(words: str) -> dict[str, Any]:
    return {"schema": {"type": "string", "format": "binary", "description": words}}


def _object(words: str, **properties: Any) -> dict[str, Any]:
    return {"schema": {"type": "object", "description": words, "properties": properties}}


_NUMBERS = {"type": "array", "items": {"type": "number"}}
_ERROR = {JSON: _object('{"error": "the reason"}', error={"type": "string"})}

QUERY_BODY = {
    "requestBody": {
        "required": True,
        "content": {
            NPY: _binary("An array (n, 3) of numbers."),
            RAW: _binary("Rows x y z, little-endian float32; float64 with dtype=float64."),
            JSON: _object(
                'Few points: {"points": [[x, y, z], ...]}.',
                points={"type": "array", "items": {**_NUMBERS, "minItems": 3, "maxItems": 3}},
            ),
        },
    }
}

_HEADERS = {
    VERSION: {"description": "The version of the map that has answered.", "schema": {"type": "integer"}},
    COLUMNS: {"description": "Of raw rows: name:count of their columns.", "schema": {"type": "string"}},
}

QUERY_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The answers, as Accept wishes; left out, .npz to .npy, and otherwise as the points came.",
        "headers": _HEADERS,
        "content": {
            NPZ: _binary(
                "Arrays names, palette, observed, probability; variance, occupancy, known if the map has them."
            ),
            RAW: _binary("Rows of little-endian float32 numbers."),
            JSON: _object("Lists of the same, and the labels, -1 where nothing was observed."),
        },
    },
    400: {"description": "What was sent makes no points, or the map cannot answer.", "content": _ERROR},
    413: {"description": "Too many bytes or points.", "content": _ERROR},
    422: {"description": "A parameter of the address that cannot be.", "content": _ERROR},
    503: {"description": "Too many queries wait, or no answer in time.", "content": _ERROR},
}

UPDATE_BODY = {
    "requestBody": {
        "required": True,
        "content": {
            NPZ: _binary("A cloud as semgp.writers.write_npz writes it: points, labels or weights, names ...")
        },
    }
}

UPDATE_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The version that has the cloud; queries are answered from it.",
        "content": {JSON: _object('{"version": 7}', version={"type": "integer"})},
    },
    202: {
        "description": "The cloud waits, or is being taken in.",
        "content": {JSON: _object('{"waiting": 1}', waiting={"type": "integer"})},
    },
    400: {"description": "What was sent makes no cloud, or none for this map.", "content": _ERROR},
    409: {"description": "The map is served read-only.", "content": _ERROR},
    413: {"description": "Too many bytes.", "content": _ERROR},
    422: {"description": "A parameter of the address that cannot be.", "content": _ERROR},
    503: {"description": "Too many updates wait.", "content": _ERROR},
}
