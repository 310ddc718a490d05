"""The result of a diagnosis, for any kind and number of records: published fields, and fields for the program."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, NotRequired

from pydantic import Field, ValidationError, field_validator, model_validator
from typing_extensions import TypedDict

from ...models.effects import EffectPlace
from ..calibrated import Calibration, OpenTarget
from ..evidence.fit import Gain
from ..fields import Count, Number, Ordered, OrderedPair
from ..noise.result import Noise
from ..result import Result, Told
from ..sieve.simple import Simple, calibration_of
from .band import BandOfFunctions
from .beyond import BeyondCatalogue, StatedLaw
from .cause import Cause, Finding, NamedEffect, causes_of, centred
from .dependence import Proven, Suffices
from .former import DIAGNOSIS, FORMER, of_former_schemas
from .hypothesis import Hypothesis
from .rivals import Standing, complexity_of
from .witness import EffectWitness, Witness

if TYPE_CHECKING:
    from polars import DataFrame

Whose = Literal["yes", "no", "open"]
KindOfExplanation = Literal["sigma", "rows", "stretch", "break", "effect", "formula", "function"]
OF_EFFECTS: dict[str, KindOfExplanation] = {"outlier": "rows", "formula": "formula", "lookup": "function"}
"""Kinds of explanations that are of such effects alone."""
FAULTS, LIMITED = "faults of the record", "not everything was tried, since the work has a limit: "
"""Name of the first stage, and beginning of the warning that names the stages that a limit of work ended."""


class Explanation(Told):
    """A model that fits the record, or all records of an instrument together.

    Attributes
    ----------
    kind : str
        "effect", one or several of the catalogue; "rows", wrong readings, rests or moves; a "stretch" of rows; a
        "break"; "sigma", a noise bound that is too small; "formula"; "function" of a quantity
    numbers : int
        parameters that it adds to the model, and one for each number that is searched for
    where : tuple of str
        places at which it acts
    causes : tuple of Cause
        its effects; empty for a function without a fitted table
    radius : float or None
        the largest error over its bound; None where the records were not fitted with it together
    sentence : str
    calibration : Calibration or None
        calibration of the extended model, where it was fitted
    extension : BeyondCatalogue or None
        a formula or table outside the catalogue: its knots, and its prediction of left-out readings
    rows : tuple of int
        numbers of wrong rows as in the file
    change : mapping
        the change that makes a row fit, or the change at a break: {"alpha_deg": -0.4002}
    within : mapping
        ends of the possible values of a change, where σ is a bound
    before_row, time_s : int, float
        place of a break
    between_rows : tuple of int
        rows, or rests of a series, between which a break may be
    basis : Fit, Simple, Standing or None
        the model that fits; None where the explanation comes from a file
    """

    kind: KindOfExplanation
    numbers: Count
    where: tuple[str, ...]
    causes: tuple[Cause, ...]
    radius: Number | None
    sentence: str
    calibration: Calibration | None = None
    extension: BeyondCatalogue | None = None
    rows: tuple[Count, ...] | None = None
    change: Mapping[str, Any] | None = None
    within: Mapping[str, Annotated[tuple[Number, Number], OrderedPair]] | None = None
    before_row: Count | None = None
    time_s: Number | None = None
    between_rows: Annotated[tuple[Count, Count], OrderedPair] | None = None
    basis: Any = Field(default=None, exclude=True)

    @staticmethod
    def of(finding: Finding, calibration: Calibration | None = None) -> "Explanation":
        """Return a set of effects that makes the model fit."""
        fit = finding.fit
        return Explanation.of_causes(finding.causes, radius=fit.radius, calibration=calibration, basis=fit)

    @staticmethod
    def of_causes(causes: tuple[Cause, ...], radius: float | None = None, **keys: Any) -> "Explanation":
        """The same by its causes."""
        effects = {cause.effect for cause in causes}
        return Explanation(
            kind=OF_EFFECTS.get(effects.pop(), "effect") if len(effects) == 1 else "effect",
            numbers=complexity_of([cause.place for cause in causes]),
            where=tuple(dict.fromkeys(cause.where for cause in causes)),
            causes=causes,
            radius=radius,
            sentence="; ".join(cause.sentence for cause in causes),
            **keys,
        )

    @staticmethod
    def of_simple(simple: Simple) -> "Explanation":
        """Return a simple fault of the record, with its accompanying effects."""
        names = ("rows", "change", "within", "before_row", "time_s", "between_rows")
        keys = {name: getattr(simple, name) for name in names}
        return Explanation(
            kind=simple.kind,
            numbers=simple.numbers,
            where=simple.where,
            causes=causes_of_simple(simple),
            radius=simple.radius,
            sentence=simple.sentence,
            calibration=calibration_of(simple),
            basis=simple,
            **{key: value for key, value in keys.items() if value not in (None, (), {})},
        )

    @staticmethod
    def of_extension(extension: BeyondCatalogue) -> "Explanation":
        """A formula or a table that is in no catalogue."""
        fit = extension.fit
        return Explanation.of_causes(extension.causes, radius=extension.radius, extension=extension, basis=fit)

    @staticmethod
    def of_function(standing: Standing) -> "Explanation":
        """A function of one quantity that does as well."""
        return Explanation(
            kind="function",
            numbers=standing.complexity,
            where=(standing.pair.where,),
            causes=(),
            radius=standing.radius,
            sentence=standing.pair.in_words,
            basis=standing,
        )


def causes_of_simple(simple: Simple) -> tuple[Cause, ...]:
    """Return the effects beside a simple fault, with their estimates and intervals."""
    if simple.fit is None:
        return ()
    causes = causes_of(simple.evidence, centred(simple.evidence, simple.fit))
    return tuple(cause for cause in causes if simple.kind != "break" or cause.place in simple.beside)


class StandsWith(Result):
    """Effects with which the model would stand, and the least noise bound for that, in the unit of the bound used.

    `effects` are empty of the model alone. `option` gives that bound, or a larger one, on the command line; it is empty
    where no option does.
    """

    effects: tuple[NamedEffect, ...]
    noise_bound: Number
    option: str

    @property
    def title(self) -> str:
        """The effects in words."""
        return " and ".join(effect.title for effect in self.effects) or "no effect"


class NextPosition(TypedDict):
    """A table position to measure, the sets that it separates, and the least difference of their predictions [g].

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
    """A second mounting to measure in: the causes it separates, their largest correlation now and with both."""

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
    """Part of a component's sum of squares that a smooth function of `on` predicts, and the part beyond noise."""

    accelerometer: NotRequired[int]
    axis: NotRequired[int]
    on: str
    explained: Number
    explainable: Number


class RecordUsed(Result):
    """The record: its rows, and the SHA-256 of its file."""

    rows: Count
    sha256: str


class BiasAtRest(Result):
    """The gyros' mean at rest that was taken out, and the errors were it left in."""

    radps: tuple[Number, ...]
    rms_if_left_in_arcmin: Number | None


class OrderedEffect(NamedEffect):
    """An effect in the order in which effects help, with the error that is left."""

    held_out_rms_arcmin: Number = 0.0


class OrderOfEffects(Result):
    """Effects in the order of their gain on the left-out errors, starting from the error of the baseline."""

    held_out_rms_arcmin: Number
    steps: tuple[OrderedEffect, ...]


class Length(Result):
    """Result of the moves or windows of one length by themselves."""

    over: str
    pieces: Count
    noise_bound_arcmin: Number
    rms_arcmin: Number
    max_arcmin: Number
    radius: Number
    smallest_sets: tuple[tuple[NamedEffect, ...], ...]
    order: OrderOfEffects | None
    order_as_measured: OrderOfEffects | None


class WithFound(Result):
    """Errors with the effects found in one record."""

    found_in: str
    rms: Number
    max: Number


class CrossGain(Result):
    """Errors of one record, simulated by FMUs: `rms`, `max` without effects, and with the effects of each record.

    `over` names the errors' spans; `unit` is "arcmin" or "g". The record's own values, its biases, are fitted to it.
    """

    record: str
    over: str
    unit: str
    rms: Number
    max: Number
    applied: tuple[WithFound, ...]


class Helps(Result):
    """An effect that was found in a record: other records on which it helps, alone or with the others found there.

    On none: it is the run's.
    """

    found_in: str
    effect: str
    on: tuple[str, ...]


class OneRecord(Result):
    """One of several records: its label, its file's SHA-256, its own diagnosis.

    `left_out`: why it is not judged with the others; `set_aside`: its fault, without which it is.
    """

    record: str
    sha256: str
    left_out: str | None
    set_aside: str | None = None
    diagnosis: "Diagnosis"


class Diagnosis(Told):
    """Result of a diagnosis: the errors of the simulation, from one record or several of an instrument.

    A position record gives readings in g, a strapdown record errors of the attitude in arcminutes, and keys of the
    lengths over which it was carried. Several records have keys of their own, from `records` on.

    Attributes
    ----------
    verdict : str
        "consistent", "explained", "ambiguous", "unexplained" or "insufficient"
    calibration : Calibration
        calibration of the model without effects
    explanations : tuple of Explanation
        with which the record stands: the named effects, or the remaining ones. The explanation with the fewest numbers
        comes first; of equal ones, that with the least radius
    causes, alternatives : tuple of Cause, tuple of such
        the effects of the explanation that is named, else none; of an ambiguous record the sets of the catalogue that
        remain, the best first
    level : str or None
        level to which the record proves the verdict: "law", "quantity" or "place"
    proven : Proven or None
        the place, and the quantity, that alone suffice, where the model is falsified
    depends_on : tuple of str
        of an unexplained record: quantities at the proven place of which a function suffices
    suffices : tuple of Suffices
        the least complex functions of one quantity at one place with which the model stands, the least complex first
    noise_bound_needed : float
        the least noise bound with which the model without effects would stand, in the unit of the bound that was used
    stands_with : tuple of StandsWith
        of an unexplained or ambiguous record: the model alone, the sets that remain, or else the single effects that
        help most, with the noise bound that each needs
    caution : tuple of str
        explanations that the record cannot tell from the causes, listed or not, and other cautions
    band : BandOfFunctions or None
        where place and quantity are proven: the ends of every function that the record leaves possible
    bands : tuple of BandOfFunctions or None
        the band of each gyro, beside those of the others, where each has a function of its own
    laws : tuple of StatedLaw
        laws that stand there: those of the catalogue, then short formulas, all of the least size
    complete : bool
        whether these are all sets of that size that explain the record; false where the search was cut off
    cut_off_at : int
        where the search was cut off: the number of effects of the sets that were not all tried, no smaller one will do
    equivalent_sets : tuple of tuple of NamedEffect
        other sets that no measurement of this kind could tell from the first
    power : tuple of Unlisted
        size from which an error outside the catalogue would have falsified the model, for any noise
    containing : tuple of tuple of NamedEffect
        sets that also suffice because they contain the named set, as a slow warm-up contains a drift: no rivals of it
    not_named : tuple of str
        why a set that would do is not named
    objections : tuple of str
        objections of the left-out readings to the first of several sets
    hypotheses : tuple of Hypothesis
        formulas that were asked about, in that order
    records : tuple of OneRecord
        each of several records alone
    shared, own : tuple of str
        parameters with one value for all records, and those of each record
    instrument : str or None
        whether every smallest set holds something that acts in all records alike: "yes", "no", or "open"
    runs : dict
        of each record whether every set holds something of that record alone
    repeatability : Calibration
        each record by itself, with the effects that are named, and what changes from record to record
    cross_gain : tuple of CrossGain
        errors of each record without effects, and with the effects found in each
    helps : tuple of Helps
        other records that each effect found improves
    noise : Noise
        the record's noise at rest against that of a scenario, where one was asked about
    evidence : Evidence
        evidence of the record, or of all that are judged together
    remaining : Evidence or None
        evidence without the rows that are named wrong, or with the larger noise bound that is named
    findings : tuple of Finding
        sets of the catalogue that were named, or that remain, the best first, with their models
    unshown : tuple of Finding
        where nothing is named: sets with which the record stands, though each size of some effect in them may be zero
    tried : tuple of (str, float)
        single effects and the radius that each leaves, the least first
    """

    schema_: Literal["trihedron.diagnosis/3"] = Field(default=DIAGNOSIS, alias="schema")
    verdict: Literal["consistent", "explained", "ambiguous", "unexplained", "insufficient"]
    calibration: Calibration
    explanations: tuple[Explanation, ...] = ()
    causes: tuple[Cause, ...]
    alternatives: tuple[tuple[Cause, ...], ...] | None = None
    unit: Literal["arcmin"] | None = None
    record: RecordUsed | None = None
    reference: Literal["gravity", "true attitude"] | None = None
    noise_bound_arcmin: Number | None = None
    reference_bound_arcmin: Number | None = None
    baseline_model: str
    level: Literal["law", "quantity", "place"] | None = None
    proven: Proven | None = None
    depends_on: tuple[str, ...] | None = None
    suffices: tuple[Suffices, ...] | None = None
    noise_bound_needed: Number | None = None
    stands_with: tuple[StandsWith, ...] | None = None
    caution: tuple[str, ...] = ()
    band: BandOfFunctions | None = None
    bands: tuple[BandOfFunctions, ...] | None = None
    laws: tuple[StatedLaw, ...] | None = None
    gain: Gain | None = None
    lengths: tuple[Length, ...] | None = None
    order_stable: bool | None = None
    bias_at_rest: BiasAtRest | None = None
    next_positions: tuple[NextPosition, ...] | None = None
    complete: bool | None = None
    cut_off_at: Count | None = None
    next: tuple[str, ...] | None = None
    equivalent_sets: tuple[tuple[NamedEffect, ...], ...] | None = None
    containing: tuple[tuple[NamedEffect, ...], ...] | None = None
    judgement: Witness | tuple[EffectWitness, ...] | None = None
    not_named: tuple[str, ...] | None = None
    objections: tuple[str, ...] | None = None
    second_mounting: SecondMounting | None = None
    targets: tuple[Annotated[Target, Ordered], ...] | None = None
    excluded: tuple[Excluded, ...] | None = None
    cannot_be_seen: tuple[NamedEffect, ...] | None = None
    power: tuple[Unlisted, ...] | None = None
    residual_structure: tuple[Dependence, ...] | None = None
    missing: tuple[OpenTarget | str, ...] | None = None
    hypotheses: tuple[Hypothesis, ...] | None = None
    records: tuple[OneRecord, ...] | None = None
    shared: tuple[str, ...] | None = None
    own: tuple[str, ...] | None = None
    instrument: Whose | None = None
    runs: Mapping[str, Whose] | None = None
    repeatability: Calibration | None = None
    cross_gain: tuple[CrossGain, ...] | None = None
    helps: tuple[Helps, ...] | None = None
    not_searched: tuple[str, ...] | None = None
    noise: Noise | None = None
    warnings: tuple[str, ...] = ()

    evidence: Any = Field(default=None, exclude=True)
    remaining: Any = Field(default=None, exclude=True)
    made_of: Any = Field(default=None, exclude=True)
    findings: tuple[Any, ...] = Field(default=(), exclude=True)
    unshown: tuple[Any, ...] = Field(default=(), exclude=True)
    tried: tuple[tuple[str, float], ...] = Field(default=(), exclude=True)
    dependence: Any = Field(default=None, exclude=True)
    beyond: Any = Field(default=None, exclude=True)

    @field_validator("explanations")
    @classmethod
    def _simplest_first(cls, explanations: tuple[Explanation, ...]) -> tuple[Explanation, ...]:
        return simplest_first(explanations)

    @model_validator(mode="after")
    def _agree(self) -> "Diagnosis":
        if self.verdict == "explained" and not (self.explanations or self.causes):
            raise ValueError("verdict explained needs an explanation")
        if self.verdict != "explained" and self.causes:
            raise ValueError(f"verdict {self.verdict} goes without causes")
        return self

    @property
    def sources(self) -> Any:
        """Return the reader of the record for drawing pages; None if the diagnosis comes from a file."""
        return None if self.evidence is None else self.evidence.reader

    @property
    def cut_off(self) -> tuple[str, ...]:
        """Return the names of the searches and stages that a limit of work ended."""
        names: list[str] = []
        for warning in self.warnings:
            if warning.startswith(LIMITED):
                names += warning.removeprefix(LIMITED).split("; ")
        return tuple(names)

    @property
    def extension(self) -> BeyondCatalogue | None:
        """A formula or a table that extends the model though it is in no catalogue."""
        for explanation in self.explanations:
            if explanation.extension is not None:
                return explanation.extension
        return None

    @property
    def radius(self) -> float | None:
        """Least largest error over its bound that the model without effects leaves."""
        return self.calibration.radius

    @property
    def noise_bound(self) -> float | None:
        """σ as a fraction of g, of several records that of the first which has one; None of records of no table."""
        if not self.records:
            return self.calibration.sigma.value
        bounds = (record.diagnosis.noise_bound for record in self.records)
        return next((bound for bound in bounds if bound is not None), None)

    @property
    def given_bound(self) -> float | None:
        """σ as a fraction of g where a person gave it for readings; else None."""
        sigma = self.calibration.sigma
        return sigma.value if self.unit is None and not self.records and sigma.kind == "bound" else None

    def get(self, effect: str, default: Any = None) -> Any:
        """Return the named cause that is this effect, or `default` where it is not named."""
        for cause in self.causes:
            if effect == cause.effect:
                return cause
        return default

    def __contains__(self, effect: object) -> bool:
        """Return true if an effect, such as "quadratic", is among the named causes."""
        return any(effect == cause.effect for cause in self.causes)

    def __iter__(self) -> Iterator[Cause]:  # type: ignore[override]
        """Go through the named causes."""
        return iter(self.causes)

    @property
    def best(self) -> Explanation | None:
        """Return the named explanation, or the first of the `alternatives`."""
        if self.verdict == "explained" and not self.causes:
            return self.explanations[0]
        for explanation in self.explanations:
            if explanation.extension is None and explanation.causes in self.sets[:1]:
                return explanation
        return None

    @property
    def sets(self) -> tuple[tuple[Cause, ...], ...]:
        """The effects that are named, or the sets of the catalogue that remain, the best first."""
        return (self.causes,) if self.causes else (self.alternatives or ())

    @property
    def stated(self) -> Calibration:
        """Return the calibration with the named effects, or without effects if none is named."""
        named = self.best if self.verdict == "explained" else None
        if named is not None and named.calibration is not None:
            return named.calibration
        return self.calibration

    @property
    def witness(self) -> Witness | None:
        """Return the witness for the effects of the first set together, where they are judged together."""
        return self.judgement if isinstance(self.judgement, Witness) else None

    @property
    def equal_sets(self) -> tuple[tuple[EffectPlace, ...], ...]:
        """`equivalent_sets` as places."""
        return _places_of(self.equivalent_sets)

    @property
    def containing_sets(self) -> tuple[tuple[EffectPlace, ...], ...]:
        """`containing` as places."""
        return _places_of(self.containing)

    @property
    def judged(self) -> tuple[str, ...]:
        """Labels of the records that are judged together."""
        return tuple(record.record for record in self.records or () if record.left_out is None)

    def causes_in(self, sha256: str) -> tuple[Cause, ...]:
        """The effects that act in a record, by its SHA-256: the instrument's, and its own if it is one of several."""
        labels = {record.record for record in self.records or () if record.sha256 and record.sha256 == sha256}
        acting = []
        for cause in self.causes:
            if cause.effect != "parameter" and (cause.is_of_instrument or cause.record in labels):
                acting.append(cause.model_copy(update={"record": None}))
        return tuple(acting)

    def to_polars(self) -> "DataFrame":
        """A row for each parameter of each cause; `set` counts the sets of effects that remain, the best first."""
        import polars as pl

        rows = []
        for number, causes in enumerate(self.sets, start=1):
            for cause in causes:
                for parameter in cause.parameters:
                    rows.append({"set": number, "effect": cause.place.title, **parameter.to_json()})
        numbers = dict.fromkeys(("estimate", "low", "high"), pl.Float64)
        schema = {"set": pl.Int64, "effect": pl.String, "name": pl.String, "unit": pl.String, **numbers}
        return pl.DataFrame(rows, schema=schema)


DIAGNOSES: Mapping[str, type[Diagnosis]] = dict.fromkeys((DIAGNOSIS, *FORMER), Diagnosis)
"""Schemas of diagnoses, of one record and of several."""


def in_present_schema(content: Mapping[str, Any]) -> dict[str, Any]:
    """The object of a diagnosis of a former schema as it is written now; any other object as it is."""
    if content.get("schema") not in FORMER:
        return dict(content)
    present = of_former_schemas(content)
    sets, extension = present.pop("sets", ()), present.pop("extension", None)
    try:
        explanations = []
        for causes, radius, calibration in sets:
            causes_of_set = tuple(Cause.model_validate(cause) for cause in causes)
            stated = None if calibration is None else Calibration.model_validate(calibration)
            explanations.append(Explanation.of_causes(causes_of_set, radius, calibration=stated))
        if extension is not None:
            explanations.append(Explanation.of_extension(BeyondCatalogue.model_validate(extension)))
    except (ValidationError, TypeError, ValueError, KeyError):
        # Something is wrong with the causes: their own fields say what.
        raw = []
        for causes, radius, _ in sets:
            raw.append(
                {"kind": "effect", "numbers": 0, "where": [], "causes": causes, "radius": radius, "sentence": ""}
            )
        return {**present, "causes": content.get("causes"), "explanations": raw}
    records = []
    for record in present.get("records", ()):
        nested = record.get("diagnosis") if isinstance(record, Mapping) else None
        records.append({**record, "diagnosis": in_present_schema(nested)} if isinstance(nested, Mapping) else record)
    if records:
        present["records"] = records
    return {**present, "explanations": [explanation.to_json() for explanation in explanations]}


def simplest_first(explanations: Sequence[Explanation]) -> tuple[Explanation, ...]:
    """Return explanations by the numbers that they need, then by their radius; one without a radius comes last.

    Among explanations with equal numbers of parameters a larger noise bound comes first: it claims least.
    """

    def rank(explanation: Explanation) -> tuple[int, bool, float]:
        radius = math.inf if explanation.radius is None else explanation.radius
        return explanation.numbers, explanation.kind != "sigma", radius

    return tuple(sorted(explanations, key=rank))


def _places_of(sets: tuple[tuple[NamedEffect, ...], ...] | None) -> tuple[tuple[EffectPlace, ...], ...]:
    places = []
    for effects in sets or ():
        places.append(tuple(effect.place for effect in effects))
    return tuple(places)


# The diagnosis of one record is a part of that of several: its type is known only here.
OneRecord.model_rebuild(force=True)
