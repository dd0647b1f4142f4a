"""JSON Schemas of the project's documents, for editors and for programs that write configs or read manifests."""

from typing import Any, Literal

from pydantic.json_schema import GenerateJsonSchema

from pipeline.validated import Validated

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


class _WithoutTitles(GenerateJsonSchema):
    """A key is its own title."""

    def field_title_should_be_set(self, schema: Any) -> bool:  # noqa: ARG002
        return False


def of(model: type[Validated], title: str, mode: Literal["validation", "serialization"]) -> dict[str, Any]:
    """The schema of a document: as it may be written ("validation"), or as this project writes it.

    It tells keys, types, ranges, choices and defaults. What ties keys together (such as either `path` or `recipe`) is
    checked when a document is read.
    """
    schema = model.model_json_schema(mode=mode, schema_generator=_WithoutTitles)
    return {"$schema": _DIALECT, **schema, "title": title}
