"""JSON Schemas of the project's documents, for editors and for programs that write configs or read manifests."""

from typing import Any, Literal

from pydantic.json_schema import GenerateJsonSchema

from pipeline.validated import Validated

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


class _WithoutTitles(GenerateJsonSchema):
    """Omits titles of fields, which would repeat their keys."""

    def field_title_should_be_set(self, schema: Any) -> bool:  # noqa: ARG002
        return False


def of(model: type[Validated], title: str, mode: Literal["validation", "serialization"]) -> dict[str, Any]:
    """Makes the JSON Schema of a document: keys, types, ranges, choices and defaults.

    Relations between keys (such as either `path` or `recipe`) are checked only when a document is read.

    model: the document. title: of the schema. mode: "validation" for documents that users write, "serialization" for
        those that this project writes.
    """
    schema = model.model_json_schema(mode=mode, schema_generator=_WithoutTitles)
    return {"$schema": _DIALECT, **schema, "title": title}
