"""Base of all results, and files of sections (TOML): typed values, and the errors of each of their fields.

Results go to JSON, come back from it, and know nothing of what shows them.
"""

import json
import math
import tomllib
from collections.abc import Callable, Mapping, Sequence, Set
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, TypeAlias, TypeVar, Union, cast, get_args, get_origin

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    GetJsonSchemaHandler,
    PlainSerializer,
    ValidationError,
    WithJsonSchema,
    model_serializer,
    model_validator,
)
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import CoreSchema

from .. import tools
from ..models.arrays import Floats
from .errors import InputError, nearest
from .fields import check_ends
from .files import advice_on, json_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _array_of(value: Any) -> Any:
    """Return a list as an array."""
    if isinstance(value, list):
        return np.asarray(value, dtype=np.float64)
    return value


Array: TypeAlias = Annotated[
    Floats,
    BeforeValidator(_array_of),
    PlainSerializer(lambda value: value.tolist()),
    WithJsonSchema({"type": "array"}),
]
"""An array of a result: nested lists in its JSON."""
Location: TypeAlias = tuple[int | str, ...]
"""Keys and indices that lead to a field, indices from 0."""
ABSENT: Any = None
"""Default of a field for the program alone, in a result that came back from its JSON."""


class _Published(GenerateJsonSchema):
    """Schema generator that skips objects without a JSON form: such fields are for the program alone."""

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
        # A command uses few of the kinds that it loads.
        defer_build=True,
    )

    omitted: ClassVar[frozenset[str]] = frozenset()
    """Keys that are left out of the JSON where they hold nothing."""

    @classmethod
    def published(cls) -> dict[str, Any]:
        """The JSON schema of the published object."""
        return cls.model_json_schema(schema_generator=_Published)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        published = handler.resolve_ref_schema(handler(schema))
        for name, field in cls.model_fields.items():
            if field.exclude:
                published.get("properties", {}).pop(field.alias or name, None)
        return published

    @model_validator(mode="after")
    def _ends_in_order(self) -> Self:
        check_ends(getattr(self, "low", None), getattr(self, "high", None))
        return self

    @model_serializer(mode="wrap")
    def _without_what_is_empty(self, handler: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        empty = (None, [], {}, "")
        return {k: v for k, v in handler(self).items() if k not in self.omitted or v not in empty}

    def to_json(self) -> dict[str, Any]:
        """The published object, of plain lists, strings and numbers."""
        return self.model_dump(mode="json")

    def json_text(self) -> str:
        """`to_json` as the text of a file."""
        return json_text(self.to_json())

    def __eq__(self, other: object) -> bool:
        """Return true if all published fields are equal."""
        return self is other or (type(self) is type(other) and self.to_json() == cast(Result, other).to_json())

    def __hash__(self) -> int:
        return hash(self.json_text())

    def __dir__(self) -> list[str]:
        """Return the fields, properties and methods of the result, without those of its base library."""
        names = set(type(self).model_fields) - {"schema_"}
        for kind in type(self).__mro__:
            if issubclass(kind, Result):
                names |= vars(kind).keys()
        return sorted(name for name in names if not name.startswith(("_", "model_")) and name != "omitted")

    def report(self, path: str | Path, record: Any = None) -> Path:
        """Write the page of the result, as its command's `--report` does.

        Parameters
        ----------
        path : path
            .html, or .pdf
        record : PositionRecord, StrapdownRecord, optional
            The record behind the result: pages of calibrations and diagnoses show more with it.

        Raises
        ------
        InputError
            where the file cannot be written, or the page not be printed
        TypeError
            where a result of this kind has no page
        """
        self._shown("page", Path(path), record)
        return Path(path)

    def figures(self, record: Any = None) -> "dict[str, Figure]":
        """The pictures of the page, as figures of matplotlib, by the titles of their sections in lower case.

        A TypeError where a result of this kind has no page.
        """
        return self._shown("figures", record)

    def figure(self, name: str, record: Any = None) -> "Figure":
        """Return one of `figures`, by its name or a unique part of it; an InputError if there is none."""
        figures = self.figures(record)
        if name in figures:
            return figures[name]
        titles = [title for title in figures if name.lower() in title]
        if len(titles) != 1:
            raise InputError(f"{name}: no picture has this name alone; known: {', '.join(figures)}")
        return figures[titles[0]]

    def _shown(self, *how: Any) -> Any:
        if tools.shown is None:
            raise TypeError("nothing shows results; import trihedron")
        return tools.shown(self, *how)

    def __str__(self) -> str:
        text = None
        if tools.shown is not None:
            text = tools.shown(self, "text")
        if text is None:
            return super().__repr__()
        return text

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str | None:
        if tools.shown is None:
            return None
        return tools.shown(self, "notebook")


class Told(Result):
    """A part written without its empty keys, except those that were given."""

    @model_serializer(mode="wrap")
    def _without_what_is_empty(self, handler: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        names = {field.alias or name: name for name, field in type(self).model_fields.items()}
        return {k: v for k, v in handler(self).items() if v is not None or names[k] in self.model_fields_set}


Kind = TypeVar("Kind", bound=Result)


def object_of(text: bytes, where: str) -> dict[str, Any]:
    """Parse bytes as a JSON object; an InputError, beginning with `where`, for anything else."""
    try:
        content = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: is not JSON text{advice_on(where, text)}") from error
    if not isinstance(content, dict):
        raise InputError(f"{where}: is not a JSON object")
    return content


def parsed_result(content: Mapping[str, Any], kinds: Mapping[str, type[Kind]], where: str) -> Kind | None:
    """Parse an object as one of several kinds of result by its schema; None where it is of none.

    An InputError, which begins with `where`, where it is not as its schema says.
    """
    schema = content.get("schema")
    if not isinstance(schema, str) or schema not in kinds:
        return None
    try:
        return kinds[schema].model_validate_json(json.dumps(content))
    except ValidationError as error:
        raise InputError(f"{where}: {field_problems(error, kinds[schema])[0][1]}") from error


def finite_or_none(value: float) -> float | None:
    """None in place of NaN and infinity, as JSON has it."""
    if math.isfinite(value):
        return float(value)
    return None


class Section(BaseModel):
    """A table of a file without other keys. Fields with ``exclude=True`` are the program's: no file has them."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, arbitrary_types_allowed=True, defer_build=True)

    def given(self, *names: str) -> list[str]:
        """Which of these fields are given."""
        return [name for name in names if getattr(self, name) is not None]

    def as_written(self) -> dict[str, Any]:
        """The section with all defaults filled in, as plain values."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)


File = TypeVar("File", bound=Section)


def read_sections(content: bytes, path: Path, model: type[File], **origin: Any) -> File:
    """Read a TOML file whose `schema` is that of the model; `origin`: fields that no file has.

    An InputError where it is not UTF-8, not TOML (with the line), or for the first field that is missing, unknown or
    wrong.
    """
    schema = model.model_fields["schema_"].default
    kind = schema.partition(".")[2].partition("/")[0]
    advice = advice_on(path, content, kind)
    try:
        sections = tomllib.loads(content.decode("utf-8-sig").replace("\r\n", "\n"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text (byte {error.start + 1}){advice}") from error
    except ValueError as error:
        raise InputError(f"{path}: is not TOML: {error}{advice}") from error
    except RecursionError as error:
        raise InputError(f"{path}: is not a {kind} (nested too deeply)") from error
    if advice:
        raise InputError(f"{path}: is no {kind}{advice}")
    if "schema" not in sections:
        raise InputError(f'{path}: schema is missing; write schema = "{schema}"')
    for problem in not_for_files(sections, model).values():
        raise InputError(f"{path}: {problem}")
    return checked_sections({**sections, **origin}, model, str(path))


def not_for_files(sections: Mapping[str, Any], model: type[BaseModel]) -> dict[str, str]:
    """Return keys that only a program may set, each with its error message."""
    fields = model.model_fields
    return {k: f"{k}: unknown key; it is not for files" for k in sections if k in fields and fields[k].exclude}


def checked_sections(sections: Mapping[str, Any], model: type[File], label: str = "") -> File:
    """Check sections as those of a file; messages call it by its label."""
    try:
        return model.model_validate(dict(sections))
    except ValidationError as error:
        problem = field_problems(error, model)[0][1]
        if label:
            problem = f"{label}: {problem}"
        raise InputError(problem) from error


def dotted(location: Location) -> str:
    """`fmus.table.component`, `connections[2].from`: entries of a list are counted from 1."""
    text = ""
    for part in location:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        elif text:
            text += f".{part}"
        else:
            text = part
    return text


def field_problems(error: ValidationError, model: type[BaseModel]) -> list[tuple[Location, str]]:
    """Return place and text of each error, in the order of the model; a text begins with the field's dotted name."""
    members = _members_of_unions(model)

    def is_member(part: int | str) -> bool:
        return part in members or "[" in str(part)

    problems = error.errors()
    deep: set[Location] = set()
    for problem in problems:
        deep.update(problem["loc"][:k] for k in range(len(problem["loc"])))
    meant, unknown = [], []
    for problem in problems:
        location = problem["loc"]
        # In a union, the member with the most valid fields is meant: errors of other members say nothing.
        if location and is_member(location[-1]) and _deeper(location, deep):
            continue
        place = tuple(part for part in location if not is_member(part))
        meant.append((problem, place))
        if problem["type"] == "extra_forbidden":
            unknown.append(place)
    return [_problem(problem, place, model, unknown) for problem, place in meant]


def _deeper(location: Location, deep: Set[Location]) -> bool:
    """Return true if another member of the same union has an error further inside."""
    return any(len(other) == len(location) and other[:-1] == location[:-1] for other in deep)


@cache
def _members_of_unions(model: type[BaseModel]) -> frozenset[str]:
    """Return names of members of unions, which pydantic puts into locations although no file has such keys."""
    models: set[type[BaseModel]] = set()
    names: set[str] = set()

    def walk(annotation: Any) -> None:
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            if annotation not in models:
                models.add(annotation)
                for field in annotation.model_fields.values():
                    walk(field.annotation)
            return
        members = [inner for inner in get_args(annotation) if inner is not type(None)]
        if get_origin(annotation) in (Union, UnionType) and len(members) > 1:
            names.update(inner.__name__ for inner in members)
        for inner in members:
            walk(inner)

    walk(model)
    return frozenset(names)


def _problem(
    problem: Mapping[str, Any], where: Location, model: type[BaseModel], unknown: Sequence[Location]
) -> tuple[Location, str]:
    name = dotted(where)
    if problem["type"] == "extra_forbidden":
        return where, f"{name}: unknown key; {nearest(str(where[-1]), _keys_beside(where, model))}"
    if problem["type"] == "missing":
        siblings = [str(place[-1]) for place in unknown if place[:-1] == where[:-1]]
        close = get_close_matches(str(where[-1]), siblings, n=1)
        if close:
            return where, f"{name}: is missing (is '{close[0]}' meant?)"
        return where, f"{name}: is missing"
    if problem["type"] == "dict_type" and isinstance(problem["input"], list):
        return where, f"{name}: is a list; write [{name}.NAME] in place of [[{name}]]"
    message = problem["msg"].removeprefix("Value error, ")
    value = repr(problem["input"])
    if problem["type"] != "value_error" and len(value) < 60:
        message += f", not {value}"
    if name:
        message = f"{name}: {message}"
    return where, " ".join(message.split())


def _keys_beside(location: Location, model: type[BaseModel]) -> list[str]:
    """Return the known keys at the last part of a location."""
    at: type[BaseModel] | None = model
    for part in location[:-1]:
        if at is None:
            break
        for name, field in at.model_fields.items():
            if part in (name, field.alias):
                at = _model_in(field.annotation)
                break
    if at is None:
        return []
    return [field.alias or name for name, field in at.model_fields.items() if not field.exclude]


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model that an annotation holds: alone, in a list or as the values of a dictionary."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((model for inner in get_args(annotation) if (model := _model_in(inner)) is not None), None)
