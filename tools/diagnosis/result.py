"""The result of a diagnosis, whatever the record: what is published, and what the program keeps beside it."""

from typing import TYPE_CHECKING, Annotated, Any, Literal, NotRequired

from pydantic import BeforeValidator, Field, model_validator
from typing_extensions import TypedDict

from ...models.effects import EffectPlace
from ..calibrated import OpenTarget, Reading
from ..evidence.fit import Gain
from ..result import Result, Told
from .band import BandOfFunctions
from .beyond import BeyondCatalogue, StatedLaw
from .cause import Cause, NamedEffect, Number
from .dependence import Proven, Suffices
from .hypothesis import Hypothesis
from .witness import EffectWitness, Witness

if TYPE_CHECKING:
    from polars import DataFrame

DIAGNOSIS, FIRST_DIAGNOSIS = "trihedron.diagnosis/2", "trihedron.diagnosis/1"


class BaselineParameter(Result):
    """A parameter of the baseline with its estimate and what the record leaves possible of it.

    `low` and `high` are None where the record falsifies the baseline, or does not bound the parameter.
    """

    name: str
    unit: str
    estimate: Number
    low: Number | None
    high: Number | None


class Baseline(Told):
    """The simulation without effects: least largest error over its bound, and what proves it false."""

    radius: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None
    falsified: bool | None
    witness: tuple[Reading, ...] | None = None
    parameters: tuple[BaselineParameter, ...] | None = None


class Extended(Result):
    """The simulation with the effects that are named, or with the best set that remains."""

    radius: Number


class NextPosition(TypedDict):
    """A table position to measure, what it separates, and by how much the predictions differ there at least [g].

    Where time matters also when, in hours since the first row, and which position of the record it repeats.
    """

    alpha_deg: Number
    beta_deg: Number
    mounting: NotRequired[str]
    hours: NotRequired[Number]
    repeats: NotRequired[int]
    approach_alpha: NotRequired[int]
    approach_beta: NotRequired[int]
    separates: NotRequired[tuple[str, ...]]
    apart_g: NotRequired[Number]


class SecondMounting(Result):
    """A mounting to measure in besides: the causes it tells apart, and their largest correlation now and with both."""

    mounting: str
    separates: tuple[str, ...]
    correlation_before: Number
    correlation_after: Number


class Target(TypedDict):
    """A target of the calibration without and with the effects, and its interval with them; None where it is open."""

    symbol: str
    before: Number
    after: Number
    low: Number | None
    high: Number | None


class Excluded(TypedDict):
    """Sizes above `above` of an effect that was not found contradict the record."""

    effect: str
    where: str
    order: NotRequired[int]
    axes: NotRequired[list[int]]
    parameter: str
    unit: str
    above: Number


class Unlisted(TypedDict):
    """An unknown function of a quantity, times a factor if any, shows at a place from a size on; None: not surely."""

    place: str
    quantity: str
    factor: NotRequired[str]
    size: Number | None
    unit: str


class Dependence(TypedDict):
    """Part of a component's sum of squares that a smooth function of `on` predicts, and what is more than noise."""

    accelerometer: NotRequired[int]
    axis: NotRequired[int]
    on: str
    explained: Number
    explainable: Number


class RecordUsed(Result):
    """The record: its rows, and the SHA-256 of its file."""

    rows: int
    sha256: str


class BiasAtRest(Result):
    """The gyros' mean at rest that was taken out, and the errors were it left in."""

    radps: tuple[Number, ...]
    rms_if_left_in_arcmin: Number | None


class OrderedEffect(NamedEffect):
    """An effect in the order in which effects help, with the error that is left."""

    held_out_rms_arcmin: Number = 0.0


class OrderOfEffects(Result):
    """In which order effects help most with what was left out, from the error of the baseline on."""

    held_out_rms_arcmin: Number
    steps: tuple[OrderedEffect, ...]


class Length(Result):
    """What the moves or windows of one length say by themselves."""

    over: str
    pieces: int
    noise_bound_arcmin: Number
    rms_arcmin: Number
    max_arcmin: Number
    radius: Number
    smallest_sets: tuple[tuple[NamedEffect, ...], ...]
    order: OrderOfEffects | None
    order_as_measured: OrderOfEffects | None


def _current(schema: Any) -> Any:
    """What a file of schema trihedron.diagnosis/1 says is read as the second: of levels it is silent."""
    return DIAGNOSIS if schema == FIRST_DIAGNOSIS else schema


class Diagnosis(Told):
    """What a record says of the simulation.

    A position record gives readings in g, and keys from the calibration of the bench; a strapdown record errors of the
    attitude in arcminutes, and keys of the lengths over which it was carried.

    Attributes
    ----------
    verdict : str
        "consistent", "explained", "ambiguous", "unexplained" or "insufficient"
    level : str or None
        how far the record carries the verdict: "law", "quantity" or "place"
    proven : Proven or None
        the place, and the quantity, that alone suffice, where the model is falsified
    depends_on : tuple of str
        of an unexplained record: quantities at the place that is proven, of each of which some function suffices
    suffices : tuple of Suffices
        the least complex functions of one quantity at one place with which the model stands, the least complex first
    noise_bound_needed : float
        the least noise bound with which the model without effects would stand, in the unit of the bound that was used
    caution : tuple of str
        what the record cannot tell from the causes, listed or not, and what else is to be borne in mind
    band : BandOfFunctions or None
        where place and quantity are proven: the ends of every function that the record leaves possible
    bands : tuple of BandOfFunctions or None
        where each of three gyros has a function of its own: the band of each, beside those of the others
    laws : tuple of StatedLaw
        laws that stand there: those of the catalogue, then short formulas, of the least size of which one stands
    extension : BeyondCatalogue or None
        a formula or a table that extends the model though it stands in no catalogue
    causes, alternatives : tuple of Cause, tuple of such
        what is named, or the best of several sets, and the other sets that remain
    complete : bool
        whether these are all sets of that size that explain the record; false where the search was cut off
    cut_off_at : int
        where the search was cut off: the number of effects of the sets that were not all tried, no smaller one will do
    equivalent_sets : tuple of tuple of NamedEffect
        other sets that no measurement of this kind could tell from the first
    power : tuple of Unlisted
        from which size on what is in no catalogue would have falsified the model, whatever the noise
    containing : tuple of tuple of NamedEffect
        sets that would do, too, as they contain what is named, as a slow warm-up contains a drift: no rivals of it
    not_named : tuple of str
        why a set that would do is not named
    objections : tuple of str
        what was left out says against the first of several sets
    hypotheses : tuple of Hypothesis
        formulas that were asked about, in that order
    evidence : Evidence
        of the record
    findings : tuple of Finding
        the set that was named, or the sets that remain, the best first, with their models
    unshown : tuple of Finding
        where nothing is named: sets with which the record stands, though each size of some effect in them may be zero
    tried : tuple of (str, float)
        single effects and the radius that each leaves, the least first
    """

    schema_: Annotated[Literal["trihedron.diagnosis/2"], BeforeValidator(_current)] = Field(
        default=DIAGNOSIS, alias="schema"
    )
    verdict: Literal["consistent", "explained", "ambiguous", "unexplained", "insufficient"]
    noise_bound: Number | None = None
    noise_bound_basis: str | None = None
    unit: Literal["arcmin"] | None = None
    record: RecordUsed | None = None
    reference: Literal["gravity", "true attitude"] | None = None
    noise_bound_arcmin: Number | None = None
    noise_bound_from: str | None = None
    reference_bound_arcmin: Number | None = None
    baseline_model: str
    baseline: Baseline
    level: Literal["law", "quantity", "place"] | None = None
    proven: Proven | None = None
    depends_on: tuple[str, ...] | None = None
    suffices: tuple[Suffices, ...] | None = None
    noise_bound_needed: Number | None = None
    caution: tuple[str, ...] = ()
    band: BandOfFunctions | None = None
    bands: tuple[BandOfFunctions, ...] | None = None
    laws: tuple[StatedLaw, ...] | None = None
    extension: BeyondCatalogue | None = None
    causes: tuple[Cause, ...]
    extended: Extended | None = None
    gain: Gain | None = None
    lengths: tuple[Length, ...] | None = None
    order_stable: bool | None = None
    bias_at_rest: BiasAtRest | None = None
    next_positions: tuple[NextPosition, ...] | None = None
    alternatives: tuple[tuple[Cause, ...], ...] | None = None
    complete: bool | None = None
    cut_off_at: int | None = None
    next: tuple[str, ...] | None = None
    equivalent_sets: tuple[tuple[NamedEffect, ...], ...] | None = None
    containing: tuple[tuple[NamedEffect, ...], ...] | None = None
    judgement: Witness | tuple[EffectWitness, ...] | None = None
    not_named: tuple[str, ...] | None = None
    objections: tuple[str, ...] | None = None
    second_mounting: SecondMounting | None = None
    targets: tuple[Target, ...] | None = None
    excluded: tuple[Excluded, ...] | None = None
    cannot_be_seen: tuple[NamedEffect, ...] | None = None
    power: tuple[Unlisted, ...] | None = None
    residual_structure: tuple[Dependence, ...] | None = None
    missing: tuple[OpenTarget | str, ...] | None = None
    hypotheses: tuple[Hypothesis, ...] | None = None
    warnings: tuple[str, ...] = ()

    evidence: Any = Field(default=None, exclude=True)
    made_of: Any = Field(default=None, exclude=True)
    findings: tuple[Any, ...] = Field(default=(), exclude=True)
    unshown: tuple[Any, ...] = Field(default=(), exclude=True)
    tried: tuple[tuple[str, float], ...] = Field(default=(), exclude=True)
    dependence: Any = Field(default=None, exclude=True)
    beyond: Any = Field(default=None, exclude=True)

    @model_validator(mode="after")
    def _agree(self) -> "Diagnosis":
        named = self.verdict in ("explained", "ambiguous")
        if named != bool(self.causes):
            raise ValueError(f"verdict {self.verdict} {'needs' if named else 'goes without'} causes")
        return self

    @property
    def witness(self) -> Witness | None:
        """What was left out says of the effects of the first set together, where that is judged so."""
        return self.judgement if isinstance(self.judgement, Witness) else None

    @property
    def equal_sets(self) -> tuple[tuple[EffectPlace, ...], ...]:
        """`equivalent_sets` as places."""
        return tuple(tuple(named.place for named in places) for places in self.equivalent_sets or ())

    @property
    def containing_sets(self) -> tuple[tuple[EffectPlace, ...], ...]:
        """`containing` as places."""
        return tuple(tuple(named.place for named in places) for places in self.containing or ())

    def to_polars(self) -> "DataFrame":
        """A row for each parameter of each cause; `set` counts the sets of effects that remain, the best first."""
        import polars as pl

        sets = (self.causes, *(self.alternatives or ())) if self.causes else ()
        rows = [
            {"set": number, "effect": cause.place.title, **parameter.to_json()}
            for number, causes in enumerate(sets, start=1)
            for cause in causes
            for parameter in cause.parameters
        ]
        numbers = dict.fromkeys(("estimate", "low", "high"), pl.Float64)
        schema = {"set": pl.Int64, "effect": pl.String, "name": pl.String, "unit": pl.String, **numbers}
        return pl.DataFrame(rows, schema=schema)
