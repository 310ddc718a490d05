"""What a campaign computes over all of its runs, as its file says it."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

Names = Annotated[list[str], Field(min_length=1)]
Part = Annotated[float, Field(ge=0.0, le=1.0)]


class Computation(BaseModel):
    """One computation; exactly one of quantiles, rate, confusion and sensitivity is given.

    Attributes
    ----------
    quantiles : list of str
        scalars whose quantiles `at` these parts are wanted
    rate : str
        a scalar; how often it is one of `is`, over ranges of `against` with these `edges`, where that is given
    confusion : str
        a text; how often each of its values goes with each value of `of`
    sensitivity : list of str
        scalars whose dependence on the parameters is wanted: Sobol indices of a Saltelli sampling, else rank
        correlations
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    quantiles: Names | None = None
    at: Annotated[list[Part], Field(min_length=1)] | None = None
    rate: str | None = None
    values: Annotated[list[str | bool], Field(min_length=1)] | None = Field(default=None, alias="is")
    against: str | None = None
    edges: Annotated[list[float], Field(min_length=2)] | None = None
    confusion: str | None = None
    of: str | None = None
    sensitivity: Names | None = None

    @model_validator(mode="after")
    def _one(self) -> "Computation":
        kinds = [name for name in ("quantiles", "rate", "confusion", "sensitivity") if getattr(self, name) is not None]
        if len(kinds) != 1:
            raise ValueError(
                f"give one of quantiles, rate, confusion, sensitivity; here: {' and '.join(kinds) or 'none'}"
            )
        companions: dict[str, tuple[str, ...]] = {"quantiles": ("at",), "rate": ("values", "against", "edges")}
        own = {**companions, "confusion": ("of",), "sensitivity": ()}[kinds[0]]
        for name in ("at", "values", "against", "edges", "of"):
            if getattr(self, name) is not None and name not in own:
                raise ValueError(f"{'is' if name == 'values' else name} does not go with {kinds[0]}")
        if self.rate is not None and self.values is None:
            raise ValueError('rate needs is = ["...", ...], the values that count')
        if (self.against is None) != (self.edges is None):
            raise ValueError("against and edges go together")
        if self.edges is not None and not all(a < b for a, b in zip(self.edges, self.edges[1:], strict=False)):
            raise ValueError("edges must rise")
        if self.confusion is not None and self.of is None:
            raise ValueError('confusion needs of = "...", the column of what is true')
        return self

    @property
    def names(self) -> list[str]:
        """Columns that the computation reads."""
        single = [name for name in (self.rate, self.against, self.confusion, self.of) if name is not None]
        return [*(self.quantiles or []), *(self.sensitivity or []), *single]

    def as_written(self) -> dict[str, Any]:
        """As plain values."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)
