"""What results have in common: typed values that go to JSON, come back from it, and know nothing of what shows them."""

import json
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    GetJsonSchemaHandler,
    PlainSerializer,
    WithJsonSchema,
    model_serializer,
)
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import CoreSchema

from .. import tools

Array: TypeAlias = Annotated[
    NDArray[np.float64],
    BeforeValidator(lambda value: np.asarray(value, dtype=np.float64) if isinstance(value, list) else value),
    PlainSerializer(lambda value: value.tolist()),
    WithJsonSchema({"type": "array"}),
]
"""An array of a result: nested lists in its JSON."""
ABSENT: Any = None
"""Default of a field for the program alone, in a result that came back from its JSON."""


class _Published(GenerateJsonSchema):
    """Takes what no JSON can hold: it stands in fields for the program alone."""

    def handle_invalid_for_json_schema(self, schema: CoreSchema, error_info: str) -> JsonSchemaValue:
        return {}


class Result(BaseModel):
    """A result; its fields are the keys of its JSON, in their order.

    Fields with ``exclude=True`` are for the program alone (arrays, fits, records) and have a default, so that a result
    comes back from its JSON: ``Kind.model_validate_json(text)``. The schema is ``Kind.published()``.
    """

    model_config = ConfigDict(
        frozen=True,
        arbitrary_types_allowed=True,
        validate_by_name=True,
        validate_by_alias=True,
        serialize_by_alias=True,
        protected_namespaces=(),
    )

    omitted: ClassVar[frozenset[str]] = frozenset()
    """Keys that are left out of the JSON where they hold nothing."""

    @classmethod
    def published(cls) -> dict[str, Any]:
        """The JSON schema of the published object."""
        return cls.model_json_schema(schema_generator=_Published)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        said = handler.resolve_ref_schema(handler(schema))
        for name, field in cls.model_fields.items():
            if field.exclude:
                said.get("properties", {}).pop(field.alias or name, None)
        return said

    @model_serializer(mode="wrap")
    def _without_what_is_empty(self, handler: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        empty = (None, [], {}, "")
        return {k: v for k, v in handler(self).items() if k not in self.omitted or v not in empty}

    def to_json(self) -> dict[str, Any]:
        """The published object, of plain lists, strings and numbers."""
        return self.model_dump(mode="json")

    def json_text(self) -> str:
        """`to_json` as the text of a file."""
        return json.dumps(self.to_json(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def __str__(self) -> str:
        return super().__str__() if tools.shown is None else tools.shown(self, "text")

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str | None:
        return None if tools.shown is None else tools.shown(self, "notebook")


class Told(Result):
    """A part of which only what was told is written: keys that hold nothing and were not given are left out."""

    @model_serializer(mode="wrap")
    def _without_what_is_empty(self, handler: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        names = {field.alias or name: name for name, field in type(self).model_fields.items()}
        return {k: v for k, v in handler(self).items() if v is not None or names[k] in self.model_fields_set}
