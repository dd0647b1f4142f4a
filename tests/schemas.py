"""JSON Schemas of docs/schemas, and what does not fit them."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

SCHEMAS = Path(__file__).parents[1] / "docs" / "schemas"


def schema_of(document: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((SCHEMAS / f"{document}.json").read_text(encoding="utf-8"))
    return found


def faults(schema: dict[str, Any], value: Any, root: dict[str, Any], path: str = "") -> list[str]:
    """Where a value does not fit a schema: its type, choices, and keys that are unknown or missing."""
    if "$ref" in schema:
        return faults(root["$defs"][schema["$ref"].rpartition("/")[2]], value, root, path)
    for several in ("anyOf", "oneOf"):
        if several in schema:
            tried = [faults(one, value, root, path) for one in schema[several]]
            fitting = sum(not found for found in tried)
            if several == "oneOf" and fitting > 1:
                return [f"{path}: fits {fitting} of oneOf"]
            # those that the best of the choices has
            return min(tried, key=len) if fitting == 0 else []
    if not fits_type(schema.get("type"), value):
        return [f"{path}: {value!r} is no {schema['type']}"]
    if value != schema.get("const", value) or value not in schema.get("enum", [value]):
        return [f"{path}: {value!r} is none of the choices"]
    return list(faults_within(schema, value, root, path))


def faults_within(schema: dict[str, Any], value: Any, root: dict[str, Any], path: str) -> Iterator[str]:
    """Faults of the items of an array and of the keys of an object."""
    if isinstance(value, list):
        for i, item in enumerate(value):
            of_items = [*schema.get("prefixItems", []), *[schema.get("items", {})] * len(value)]
            yield from faults(of_items[i], item, root, f"{path}.{i}")
    if isinstance(value, dict):
        known, others = schema.get("properties", {}), schema.get("additionalProperties", True)
        yield from (f"{path}.{key}: missing" for key in schema.get("required", []) if key not in value)
        for key, item in value.items():
            if key in known:
                yield from faults(known[key], item, root, f"{path}.{key}")
            elif others is False:
                yield f"{path}.{key}: unknown key"
            elif isinstance(others, dict):
                yield from faults(others, item, root, f"{path}.{key}")


def fits_type(name: str | None, value: Any) -> bool:
    """Whether a value is of a JSON type; True is no number."""
    types: dict[str | None, Any] = {
        None: object,
        "object": dict,
        "array": list,
        "string": str,
        "boolean": bool,
        "integer": int,
        "number": int | float,
        "null": type(None),
    }
    return isinstance(value, types[name]) and (name in (None, "boolean") or not isinstance(value, bool))
