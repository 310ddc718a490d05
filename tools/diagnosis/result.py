"""The result of a diagnosis, as an object and as JSON."""

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectPlace
from ..calibration.result import Calibration
from ..shown import Shown
from .extended_fit import ExtendedFit
from .gain import Gain
from .judgement import Judgement
from .second_mounting import SecondMounting

if TYPE_CHECKING:
    from polars import DataFrame

SCHEMA = "trihedron.diagnosis/1"


@dataclass(frozen=True)
class Cause:
    """An effect that explains the record, alone or with others.

    Attributes
    ----------
    place : EffectPlace
        with the record's own position number for an outlier
    equivalents : tuple of EffectPlace
        what no measurement on this bench could tell from it
    values : tuple of float
        its parameters
    intervals : tuple of (low, high)
        what the measurements leave possible
    """

    place: EffectPlace
    equivalents: tuple[EffectPlace, ...]
    values: tuple[float, ...]
    intervals: tuple[tuple[float, float], ...]

    @property
    def sentence(self) -> str:
        """What an engineer is told."""
        effect = CATALOGUE[self.place.effect].at(self.place)
        named = {p.name: value for p, value in zip(effect.parameters, self.values, strict=True)}
        return effect.sentence(self.place, named)

    def to_json(self) -> dict[str, Any]:
        """The entry of `causes`."""
        parameters = [
            {
                "name": parameter.name,
                "unit": parameter.unit,
                "estimate": value,
                "low": low if math.isfinite(low) else None,
                "high": high if math.isfinite(high) else None,
            }
            for parameter, value, (low, high) in zip(
                CATALOGUE[self.place.effect].at(self.place).parameters, self.values, self.intervals, strict=True
            )
        ]
        entry = place_json(self.place)
        return {**entry, "equivalents": [place_json(e) for e in self.equivalents], "parameters": parameters}


def place_json(place: EffectPlace) -> dict[str, Any]:
    """An effect at its place as the contract writes it."""
    entry: dict[str, Any] = {"effect": place.effect, "where": place.where}
    if place.order is not None:
        entry["order"] = place.order
    if place.effect == "outlier":
        entry["accelerometer"] = place.axes[0]
    elif place.axes:
        entry["axes"] = list(place.axes)
    return entry


@dataclass(frozen=True)
class Finding:
    """A smallest set of effects that makes the record consistent.

    Attributes
    ----------
    causes : tuple of Cause
    fit : ExtendedFit
        the model with them
    """

    causes: tuple[Cause, ...]
    fit: ExtendedFit

    @property
    def title(self) -> str:
        """The effects in words."""
        return " and ".join(cause.place.title for cause in self.causes)

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """The effects."""
        return tuple(cause.place for cause in self.causes)


@dataclass(frozen=True, repr=False)
class Diagnosis(Shown):
    """What a record says of the simulation's model.

    Attributes
    ----------
    verdict : str
        "consistent", "explained", "ambiguous", "unexplained" or "insufficient"
    baseline : Calibration
        of the nominal model
    position_numbers : (N,) array of int
        the record's own numbers of its rows
    findings : tuple of Finding
        the set that was named, or the sets that remain, the best first
    equivalent_sets : tuple of tuple of EffectPlace
        other sets that no measurement on this bench could tell from the first
    tried : tuple of (str, float)
        single effects and the radius that each leaves, the least first
    gain : Gain or None
        None where nothing is named or too few positions remain
    next_positions : tuple of dict
        what to measure next
    residual_structure : tuple of dict
        of an unexplained residual
    excluded : tuple of dict
        upper bounds of effects that were not found
    targets : tuple of dict
        the calibration's targets before and after the extension
    complete : bool
        whether `findings` are all sets of that size that explain the record
    judgement : Judgement or None
        what readings that were left out say of the first finding
    mounting : SecondMounting or None
        a mounting that would tell apart what the record's mountings cannot
    """

    verdict: str
    baseline: Calibration
    position_numbers: NDArray
    findings: tuple[Finding, ...] = ()
    equivalent_sets: tuple[tuple[EffectPlace, ...], ...] = ()
    tried: tuple[tuple[str, float], ...] = ()
    gain: Gain | None = None
    next_positions: tuple[dict[str, Any], ...] = ()
    residual_structure: tuple[dict[str, Any], ...] = ()
    excluded: tuple[dict[str, Any], ...] = ()
    targets: tuple[dict[str, Any], ...] = ()
    complete: bool = True
    judgement: Judgement | None = None
    mounting: SecondMounting | None = None

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The effects that were named, or the best of several sets."""
        return self.findings[0].causes if self.findings else ()

    @property
    def alternatives(self) -> tuple[tuple[Cause, ...], ...]:
        """The other sets that remain."""
        return tuple(finding.causes for finding in self.findings[1:])

    def to_json(self) -> dict[str, Any]:
        """The object of schema trihedron.diagnosis/1."""
        content: dict[str, Any] = {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "noise_bound": self.baseline.noise_bound,
            "noise_bound_basis": self.baseline.noise_bound_basis,
            "baseline_model": self.baseline.baseline,
            "baseline": {
                "radius": self.baseline.radius,
                "falsified": self.baseline.verdict == "falsified",
                "witness": [reading.to_json() for reading in self.baseline.witness],
            },
            "causes": [cause.to_json() for cause in self.causes],
            "extended": {"radius": self.findings[0].fit.radius} if self.findings else None,
            "gain": self.gain.summary() if self.gain is not None else None,
            "next_positions": list(self.next_positions),
        }
        if self.verdict == "ambiguous":
            content["alternatives"] = [[cause.to_json() for cause in causes] for causes in self.alternatives]
            content["complete"] = self.complete
        if self.equivalent_sets:
            content["equivalent_sets"] = [[place_json(place) for place in places] for places in self.equivalent_sets]
        if self.judgement is not None:
            content["judgement"] = self.judgement.to_json()
        if self.mounting is not None:
            content["second_mounting"] = self.mounting.to_json()
        if self.targets:
            content["targets"] = list(self.targets)
        if self.excluded:
            content["excluded"] = list(self.excluded)
        if self.verdict == "unexplained":
            content["residual_structure"] = list(self.residual_structure)
        if self.verdict == "insufficient":
            content["missing"] = [gap.to_json() for gap in self.baseline.missing]
        content["warnings"] = list(self.baseline.warnings)
        return content

    def json_text(self) -> str:
        """`to_json` as text."""
        return json.dumps(self.to_json(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def lines(self) -> list[str]:
        """Verdict, evidence, cause and gain."""
        from ..summaries import diagnosis_summary

        shown: Any = self
        return diagnosis_summary(shown).split("\n")

    def to_polars(self) -> "DataFrame":
        """A row for each parameter of each cause; `set` counts the sets of effects that remain, the best first."""
        import polars as pl

        rows = [
            {"set": number, "effect": cause.place.title, **parameter}
            for number, finding in enumerate(self.findings, start=1)
            for cause in finding.causes
            for parameter in cause.to_json()["parameters"]
        ]
        numbers = dict.fromkeys(("estimate", "low", "high"), pl.Float64)
        schema = {"set": pl.Int64, "effect": pl.String, "name": pl.String, "unit": pl.String, **numbers}
        return pl.DataFrame(rows, schema=schema)
