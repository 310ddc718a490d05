"""The published objects as models: what a file of results must have. Keys beside these are let through."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Number = Annotated[float, Field(allow_inf_nan=False)]


class _Object(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True, frozen=True)


class TablePosition(_Object):
    """Angles of the table."""

    alpha_deg: Number
    beta_deg: Number


class EffectParameter(_Object):
    """A parameter of a cause; an end is null where nothing bounds it."""

    name: str
    unit: str
    estimate: Number
    low: Number | None
    high: Number | None


class Cause(_Object):
    """An effect at its place."""

    effect: str
    where: str
    equivalents: list[dict[str, Any]]
    parameters: list[EffectParameter]


class Baseline(_Object):
    """The nominal model's fit; of a strapdown record null where it could not be tried."""

    radius: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None
    falsified: bool | None
    witness: list[Any] = []


class DiagnosisFile(_Object):
    """Schema trihedron.diagnosis/1."""

    schema_: Literal["trihedron.diagnosis/1"] = Field(alias="schema")
    verdict: Literal["consistent", "explained", "ambiguous", "unexplained", "insufficient"]
    baseline_model: str
    baseline: Baseline
    causes: list[Cause]
    next_positions: list[dict[str, Any]] = []
    alternatives: list[list[Cause]] = []

    @model_validator(mode="after")
    def _agree(self) -> "DiagnosisFile":
        named = self.verdict in ("explained", "ambiguous")
        if named != bool(self.causes):
            raise ValueError(f"verdict {self.verdict} {'needs' if named else 'goes without'} causes")
        return self


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
