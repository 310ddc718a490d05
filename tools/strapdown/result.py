"""The result of the diagnosis of a strapdown record, as an object and as JSON."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..diagnosis.result import Cause, NamedEffect
from ..evidence.evidence import Part
from ..evidence.gain import ARCMIN, Gain
from ..motion.inspect import Inspection
from ..shown import Shown
from .judging import Order, Witness

if TYPE_CHECKING:
    from polars import DataFrame


@dataclass(frozen=True)
class BaselineParameter:
    """A parameter of the baseline with its estimate and what the record leaves possible.

    Attributes
    ----------
    name, unit : str
    estimate : float
    low, high : float or None
        None where the record falsifies the baseline, or does not bound the parameter
    """

    name: str
    unit: str
    estimate: float
    low: float | None
    high: float | None


@dataclass(frozen=True, eq=False)
class Length:
    """What the moves or windows of one length say by themselves.

    Attributes
    ----------
    label : str
    pieces : int
    bound : float
        median of the bounds [rad]
    rms, largest : float
        of the baseline's errors [rad]
    radius : float
        of the baseline, this length alone
    sets : tuple of tuple of EffectPlace
        the smallest sets that stand; the empty set where the baseline stands
    order : Order or None
        in which order effects help with what was left out
    as_measured : Order or None
        the same with the gyros' mean at rest left in
    """

    label: str
    pieces: int
    bound: float
    rms: float
    largest: float
    radius: float
    sets: tuple[tuple[EffectPlace, ...], ...]
    order: Order | None = None
    as_measured: Order | None = None

    def to_json(self) -> dict[str, Any]:
        """An entry of `lengths`."""
        return {
            "over": self.label,
            "pieces": self.pieces,
            "noise_bound_arcmin": self.bound / ARCMIN,
            "rms_arcmin": self.rms / ARCMIN,
            "max_arcmin": self.largest / ARCMIN,
            "radius": self.radius,
            "smallest_sets": [[NamedEffect.keys(place) for place in places] for places in self.sets],
            "order": order_json(self.order),
            "order_as_measured": order_json(self.as_measured),
        }


def order_json(order: Order | None) -> dict[str, Any] | None:
    """An order of effects, with the errors that are left [arcmin]."""
    if order is None:
        return None
    steps = [{**NamedEffect.keys(place), "held_out_rms_arcmin": left / ARCMIN} for place, left in order.steps]
    return {"held_out_rms_arcmin": order.start / ARCMIN, "steps": steps}


@dataclass(frozen=True, eq=False, repr=False)
class StrapdownDiagnosis(Shown):
    """What a strapdown record says of the simulation's model.

    Attributes
    ----------
    verdict : str
        "consistent", "explained", "ambiguous", "unexplained" or "insufficient"
    inspection : Inspection
    reference : str
        "gravity" or "true attitude"
    baseline : str
        "calibrated" or "nominal"
    radius : float or None
        of the baseline; None where it could not be tried
    extended_radius : float or None
        of the first set
    noise_bound : float or None
        median of the bounds of the errors by which it is judged [rad]
    noise_bound_from : str
    candidates : tuple of tuple of Cause
        the sets that remain, the best first; one where a cause is named
    parameters : tuple of BaselineParameter
    lengths : tuple of Length
    order_stable : bool or None
    witnesses : tuple of Witness
        what was left out says of the effects of the first set
    objections : tuple of str
        why a set that would do is not named
    gain : Gain or None
    excluded, residual_structure : tuple of dict
    missing, separate : tuple of str
        what to add, what to measure to tell the sets apart
    tried : tuple of (str, float)
        single effects and the radius that each leaves, the least first
    not_seen : tuple of EffectPlace
        effects that this record could not show at any possible size
    bias_at_rest : (3,) array or None
        taken out of the rates of the nominal block [rad/s]
    bias_left_in : float or None
        root mean square error of the pieces that are quoted, were it left in [rad]
    warnings : tuple of str
    parts : tuple of Part
        the baseline's errors, for pictures
    left : tuple of (S, d) array
        errors with the first set at its Chebyshev centre, for pictures
    quoted : int
        number of the part whose errors are quoted
    quantities : mapping
        of the pieces of that part what their errors may depend on: name -> (S, k) array
    complete : bool
        whether `candidates` are all sets of that size
    compared : tuple of EffectPlace
        the effects of the sets that remain, then those that leave least
    alike : (K, K) array or None
        how alike these look in the record (`trihedron.tools.strapdown.likeness`)
    rates : str
        what the record's rates were taken for: "instantaneous" or "averaged"
    """

    verdict: str
    inspection: Inspection
    reference: str
    baseline: str
    radius: float | None = None
    extended_radius: float | None = None
    noise_bound: float | None = None
    noise_bound_from: str = ""
    candidates: tuple[tuple[Cause, ...], ...] = ()
    parameters: tuple[BaselineParameter, ...] = ()
    lengths: tuple[Length, ...] = ()
    order_stable: bool | None = None
    witnesses: tuple[Witness, ...] = ()
    objections: tuple[str, ...] = ()
    gain: Gain | None = None
    excluded: tuple[dict[str, Any], ...] = ()
    residual_structure: tuple[dict[str, Any], ...] = ()
    missing: tuple[str, ...] = ()
    separate: tuple[str, ...] = ()
    tried: tuple[tuple[str, float], ...] = ()
    not_seen: tuple[EffectPlace, ...] = ()
    bias_at_rest: NDArray[np.float64] | None = None
    bias_left_in: float | None = None
    warnings: tuple[str, ...] = ()
    parts: tuple[Part, ...] = ()
    left: tuple[NDArray[np.float64], ...] = ()
    quoted: int = 0
    quantities: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    complete: bool = True
    compared: tuple[EffectPlace, ...] = ()
    alike: NDArray[np.float64] | None = None
    rates: str = "instantaneous"

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The effects that were named, or the best of several sets; none where nothing is."""
        return self.candidates[0] if self.candidates and self.verdict in ("explained", "ambiguous") else ()

    @property
    def alternatives(self) -> tuple[tuple[Cause, ...], ...]:
        """The other sets that remain."""
        return self.candidates[1:] if self.verdict == "ambiguous" else ()

    def to_json(self) -> dict[str, Any]:
        """The object of schema trihedron.diagnosis/1 for a strapdown record."""
        bound = None if self.noise_bound is None else self.noise_bound / ARCMIN
        record = self.inspection.record
        content: dict[str, Any] = {
            "schema": "trihedron.diagnosis/1",
            "verdict": self.verdict,
            "unit": "arcmin",
            "record": {"rows": len(record), "sha256": record.sha256},
            "reference": self.reference,
            "noise_bound_arcmin": bound,
            "noise_bound_from": self.noise_bound_from,
            "baseline_model": self.baseline,
            "baseline": {
                "radius": self.radius,
                "falsified": None if self.radius is None else self.radius > 1.0,
                "parameters": [
                    {"name": p.name, "unit": p.unit, "estimate": p.estimate, "low": p.low, "high": p.high}
                    for p in self.parameters
                ],
            },
            "causes": [cause.to_json() for cause in self.causes],
            "extended": {"radius": self.extended_radius} if self.causes else None,
            "gain": self.gain.to_json() if self.gain is not None else None,
            "lengths": [length.to_json() for length in self.lengths],
            "order_stable": self.order_stable,
        }
        if self.bias_at_rest is not None:
            left_in = None if self.bias_left_in is None else self.bias_left_in / ARCMIN
            content["bias_at_rest"] = {"radps": self.bias_at_rest.tolist(), "rms_if_left_in_arcmin": left_in}
        if self.verdict == "ambiguous":
            content["alternatives"] = [[cause.to_json() for cause in causes] for causes in self.alternatives]
            content["complete"] = self.complete
            content["next"] = list(self.separate)
        if self.witnesses:
            content["judgement"] = [witness.to_json() for witness in self.witnesses]
        if self.objections:
            content["not_named"] = list(self.objections)
        if self.excluded:
            content["excluded"] = list(self.excluded)
        if self.not_seen:
            content["cannot_be_seen"] = [NamedEffect.keys(place) for place in self.not_seen]
        if self.verdict == "unexplained":
            content["residual_structure"] = list(self.residual_structure)
        if self.verdict == "insufficient":
            content["missing"] = list(self.missing)
        content["warnings"] = list(self.warnings)
        return content

    def json_text(self) -> str:
        """`to_json` as text."""
        return json.dumps(self.to_json(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def lines(self) -> list[str]:
        """What a person reads."""
        from .summary import diagnosis_lines

        shown: Any = self
        return diagnosis_lines(shown)

    def to_polars(self) -> "DataFrame":
        """Causes and their parameters, as a table."""
        from .summary import causes_table

        shown: Any = self
        return causes_table(shown)
