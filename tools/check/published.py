"""The published objects as models: what a file of results must have. Keys beside these are let through."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Number = Annotated[float, Field(allow_inf_nan=False)]


class _Object(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True, frozen=True)


class TablePosition(_Object):
    """Angles of the table."""

    alpha_deg: Number
    beta_deg: Number


class PlannedReading(_Object):
    """A reading and its weight."""

    accelerometer: Annotated[int, Field(ge=1, le=3)]
    alpha_deg: Number
    beta_deg: Number
    weight: Number


class TargetPlanFile(_Object):
    """Schema trihedron.plan/1, of one target."""

    schema_: Literal["trihedron.plan/1"] = Field(alias="schema")
    target: str
    cost: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    gap: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    weights: Annotated[list[PlannedReading], Field(min_length=1)]


class TargetPlansFile(_Object):
    """Schema trihedron.plan/1, of several targets."""

    schema_: Literal["trihedron.plan/1"] = Field(alias="schema")
    plans: Annotated[list[TargetPlanFile], Field(min_length=1)]


class PositionPlanFile(_Object):
    """Schema trihedron.plan/1, of a common set of positions."""

    schema_: Literal["trihedron.plan/1"] = Field(alias="schema")
    positions: Annotated[list[TablePosition], Field(min_length=1)]
    worst_ratio: Annotated[float, Field(ge=1.0 - 1e-9, allow_inf_nan=False)]
    lower_bound: Number | None
    lower_bound_on: str | None
    costs: dict[str, Number]
