"""What is wrong with the fields of a file that pydantic has checked: every problem in one line, by the field's name."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from .errors import nearest

Location = tuple[int | str, ...]
"""Keys and indices that lead to a field, indices from 0."""


@dataclass(frozen=True)
class FieldProblem:
    """What is wrong with one field.

    Attributes
    ----------
    location : tuple of str and int
    text : str
        one line that begins with the field's dotted name
    """

    location: Location
    text: str


def dotted(location: Location) -> str:
    """`fmus.table.component`, `connections[2].from`: entries of a list are counted from 1."""
    text = ""
    for part in location:
        text += f"[{part + 1}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def field_problems(error: ValidationError, model: type[BaseModel], hidden: Sequence[str] = ()) -> list[FieldProblem]:
    """Everything that is wrong, in the order of the model.

    Parameters
    ----------
    error : ValidationError
        what pydantic says
    model : type
        what was checked
    hidden : sequence of str
        fields of the model that no file has
    """
    problems = error.errors()
    unknown = [_location(problem) for problem in problems if problem["type"] == "extra_forbidden"]
    return [_problem(problem, model, hidden, unknown) for problem in problems]


def _location(problem: Mapping[str, Any]) -> Location:
    return tuple(part for part in problem["loc"] if part != "[key]")


def _problem(
    problem: Mapping[str, Any], model: type[BaseModel], hidden: Sequence[str], unknown: Sequence[Location]
) -> FieldProblem:
    where = _location(problem)
    name = dotted(where)
    if problem["type"] == "extra_forbidden":
        known = [key for key in _keys_beside(where, model) if key not in hidden]
        return FieldProblem(where, f"{name}: unknown key; {nearest(str(where[-1]), known)}")
    if problem["type"] == "missing":
        beside = [str(other[-1]) for other in unknown if other[:-1] == where[:-1]]
        close = get_close_matches(str(where[-1]), beside, n=1)
        meant = f" (is '{close[0]}' meant?)" if close else ""
        return FieldProblem(where, f"{name}: is missing{meant}")
    message = problem["msg"].removeprefix("Value error, ")
    shown = repr(problem["input"])
    if problem["type"] != "value_error" and len(shown) < 60:
        message += f", not {shown}"
    return FieldProblem(where, " ".join((f"{name}: {message}" if name else message).split()))


def _keys_beside(location: Location, model: type[BaseModel]) -> list[str]:
    """The keys that are known where the last part of a location stands."""
    at: type[BaseModel] | None = model
    for part in location[:-1]:
        if at is None:
            break
        for name, field in at.model_fields.items():
            if part in (name, field.alias):
                at = _model_in(field.annotation)
                break
    return [] if at is None else [field.alias or name for name, field in at.model_fields.items()]


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model that an annotation holds: alone, in a list or as the values of a dictionary."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for inner in get_args(annotation) if (found := _model_in(inner)) is not None), None)
