"""Results of a calibration: the parameters of a model, from one or several records of any kind.

A `Calibration` is what `calibrate` returns, of positions, of a bench with gyros, of several records together, and what
`inspect` says of accelerometers by the norm of gravity. Its JSON is `trihedron.calibration/3`; a field that holds
nothing is left out. Files of the schemas before are converted where they are read (`fmus.parameters`).
"""

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NotRequired

from pydantic import ConfigDict, Field, model_validator
from typing_extensions import TypedDict

from ..fmus import version
from ..fmus.parameters import BY_GRAVITY, GRAVITIES, calibration_of, gives_parameters
from ..models.bench import GYRO_PARAMETERS, TARGETS
from .errors import InvalidInput, nearest
from .fields import Axis, Count, Covariance, Direction, Number, Probability, Range, Rotation, Size
from .quantity import Quantity
from .result import ABSENT, Result, finite_or_none
from .rounding import upwards

if TYPE_CHECKING:
    from polars import DataFrame

Verdict = Literal["consistent", "falsified", "insufficient", "noise-unknown", "usable"]
Estimator = Literal["analytic centre", "central programme", "a priori", "least squares"]
LATENCIES = ("A", "L-A")
"""Lag of the accelerometers behind the encoders, and of the gyros behind the accelerometers."""
OF_GYROS = frozenset((*GYRO_PARAMETERS, *LATENCIES))
GYRO_UNITS = {"B": ("rad/s",), "M": ("1", "rad"), "S": ("rad/s/g",), "L": ("s",), "A": ("s",)}
"""Units of the gyros' parameters and of the lags, by the first letter of the symbol."""
NUMBERS = ("estimate", "standard_error", "low", "high", "a_priori", "guaranteed_error", "least_squares")
UNITS = {
    "sigma": "g",
    "gravity_mps2": "m/s2",
    "radius": "1",
    "parameters": "of all numbers of a parameter: as its unit says",
    "reading_errors": "g",
}


def units_of(symbol: str) -> tuple[str, ...]:
    """Return the units that a parameter's numbers can have; none for a symbol of another kind."""
    if symbol in OF_GYROS:
        return GYRO_UNITS[symbol[0]]
    if symbol in TARGETS[-3:] or symbol.startswith("bias_"):
        return ("g",)
    if symbol in TARGETS or symbol in BY_GRAVITY:
        return ("1", "rad")
    return ()


class Part(Result):
    """A part of a calibration, validated strictly: text is not accepted as a number."""

    model_config = ConfigDict(strict=True)


class Sigma(Part):
    """The bound σ of the readings' errors, as a fraction of g.

    Attributes
    ----------
    value : float or None
        None where each record, or each reading, has a bound of its own
    kind : str
        "bound": a person gave it; "estimated": the record tells it; "unknown": it has no known source, or only the
        scatter within rests. That scatter does not show an error that holds over a whole rest
    basis : str
        source of σ; `from` in the JSON
    find : str
        way to find a bound, where it is unknown
    """

    omitted: ClassVar[frozenset[str]] = frozenset({"find"})

    value: Annotated[float, Field(gt=0.0, lt=1.0)] | None
    kind: Literal["bound", "estimated", "unknown"]
    basis: str = Field(alias="from")
    find: str = ""

    @staticmethod
    def of(value: float | None, basis: str) -> "Sigma":
        """Return the noise bound that a person gave, with "given" as its basis, or that records tell."""
        kind = "bound" if basis == "given" else "estimated"
        return Sigma.model_validate({"value": value, "kind": kind, "from": basis})


EACH_ITS_OWN = Sigma.of(None, "each record has its own")
"""σ of several records."""


class Parameter(Part):
    """Result for one parameter, or for a linear combination of parameters.

    Attributes
    ----------
    symbol, name, unit : str
        as the paper writes it, in words, and its unit
    determined : bool
        true if the records determine it
    estimate : float or None
        a possible value, as the calibration's `estimator` says; of a falsified model that of least squares
    standard_error : float or None
        of least squares, from the scatter of the residuals; None where these leave no freedom
    low, high : float or None
        exact ends of the possible values; None where the records falsify the model or leave an end open
    a_priori, guaranteed_error : float or None
        by the weights of the linear programme, which are best before anything is read, and the largest error that it
        can have: σ times the l1 norm of the weights. The readings may prove the a-priori estimate impossible.
    least_squares : float or None
        the fit of the exact model
    """

    derived: ClassVar[dict[str, Quantity]] = {
        "central": Quantity("estimate", "", "estimate"),
        "error_bound": Quantity("to within", "", "up"),
    }
    """How properties are shown."""

    symbol: Annotated[str, Quantity("target")]
    name: Annotated[str, Quantity("meaning")]
    unit: Annotated[str, Quantity("unit")]
    determined: bool
    estimate: Annotated[Number | None, Quantity("estimate", "", "to the estimate's place")]
    standard_error: Annotated[Size | None, Quantity("standard error", "", "nearest", 2)] = None
    low: Annotated[Number | None, Quantity("low", "", "low")]
    high: Annotated[Number | None, Quantity("high", "", "high")]
    a_priori: Annotated[Number | None, Quantity("a priori", "", "to the estimate's place")] = None
    guaranteed_error: Annotated[Size | None, Quantity("guaranteed error", "", "up")] = None
    least_squares: Annotated[Number | None, Quantity("least squares", "", "to the estimate's place")] = None

    @model_validator(mode="after")
    def _in_its_unit(self) -> "Parameter":
        units = units_of(self.symbol)
        if units and self.unit not in units:
            raise ValueError(f"the unit of {self.symbol} is {self.unit!r}, and must be {' or '.join(units)}")
        return self

    @property
    def bounded(self) -> bool:
        """Return true if both ends are known."""
        return self.low is not None and self.high is not None

    @property
    def central(self) -> float | None:
        """The estimate where both ends are known; None of a falsified model."""
        return self.estimate if self.bounded else None

    @property
    def ends(self) -> tuple[float, float]:
        """Return the ends of the possible values; an end is infinite where nothing bounds it."""
        return -math.inf if self.low is None else self.low, math.inf if self.high is None else self.high

    @property
    def error_bound(self) -> float | None:
        """The largest error that the estimate can have; None where an end is not known."""
        if self.estimate is None or self.low is None or self.high is None:
            return None
        return max(self.estimate - self.low, self.high - self.estimate)

    @property
    def place(self) -> float | None:
        """The error that sets the last digit of an estimate: half of the interval, else the largest or the standard."""
        if self.low is None or self.high is None or self.high == self.low:
            return self.standard_error if self.guaranteed_error is None else self.guaranteed_error
        return 0.5 * (self.high - self.low)

    def possible(self, value: float | None) -> bool:
        """Return true if a value lies in the interval, or if the value or an end is unknown."""
        return value is None or self.low is None or self.high is None or self.low <= value <= self.high


class ReadingError(Part):
    """Error of an accelerometer [g] at one input (3,) [g]: least and largest possible value.

    None where the readings do not determine it.
    """

    accelerometer: Axis
    input: Annotated[list[Annotated[int, Field(ge=-1, le=1)]], Field(min_length=3, max_length=3)]
    low: Number | None
    high: Number | None

    @staticmethod
    def of(accelerometer: int, n: tuple[int, int, int], low: float, high: float) -> "ReadingError":
        """The error with ends that are not finite where it is not determined."""
        return ReadingError(
            accelerometer=accelerometer, input=list(n), low=finite_or_none(low), high=finite_or_none(high)
        )


class Open(Part):
    """A direction that the records leave undetermined: its parameters, and the readings that would determine it."""

    parameters: list[str]
    close_by: str = ""


class OpenTarget(Part):
    """A parameter that a record does not determine, as diagnoses name it."""

    symbol: str
    name: str


class Reading(Part):
    """A reading that proves a falsification: the record's number of its position, and the accelerometer."""

    position: Annotated[int, Field(ge=1)]
    accelerometer: Axis


class Turn(Part):
    """A piece of a bench record that proves a falsification: its gyro, from 1, and when it begins and ends [s]."""

    gyro: Axis
    from_s: Number
    to_s: Number


class GainOfTurns(Part):
    """Gain from the gyros: a parameter's guaranteed error from the accelerometers alone, and from both."""

    symbol: str
    accelerometers_alone: Size
    with_gyros: Size


class Gyros(Part):
    """Basis and gain of the calibration of the gyros of a bench record.

    Attributes
    ----------
    pieces : int
        rests, moves and parts of moves over which the gyros are integrated
    noise_basis : str
        basis of the bounds of the gyros' noise
    encoder_bound : float
        bound of an encoder's error [rad]
    latitude_deg, azimuth_deg : float
        place of the bench and its outer axis, from north towards east
    gains : list of GainOfTurns
        parameters of the bench that the turns make known better
    witness : list of Turn
        the pieces that prove a falsification
    radius_of_rests : float or None
        least largest residual of the accelerometers at rest by themselves, over its bound
    """

    omitted: ClassVar[frozenset[str]] = frozenset({"radius_of_rests"})

    pieces: Count
    noise_basis: str
    encoder_bound: Size = Field(alias="encoder_bound_rad")
    latitude_deg: Annotated[float, Field(ge=-90.0, le=90.0)]
    azimuth_deg: Number
    gains: list[GainOfTurns]
    witness: list[Turn]
    radius_of_rests: Size | None = None


class KnownBefore(Part):
    """A limit known before the calibration: |expression| ≤ limit."""

    expression: str
    limit: Size


class Provenance(Part):
    """Source of a calibration: the record's file and its SHA-256 (empty without a file), bounds of (1.7).

    `angle_steps_deg` are the steps of both encoders whose rounding is in the bounds; None where it is not. `decisions`
    are those of a person about the record.
    """

    omitted: ClassVar[frozenset[str]] = frozenset(
        {"kind", "temperature_degC", "angle_steps_deg", "comments", "decisions"}
    )

    trihedron: str = Field(default_factory=version)
    record: str
    sha256: str = Field(default="", alias="record_sha256")
    bounds: Annotated[list[Size], Field(max_length=2)] = Field(default=[])
    kind: str = ""
    temperature: Range | None = Field(default=None, alias="temperature_degC")
    angle_steps_deg: Annotated[list[Size], Field(min_length=2, max_length=2)] | None = None
    comments: dict[str, str] = Field(default={})
    decisions: str = ""


class PoseError(Part):
    """Predicted error of the norm of gravity in the worst unseen pose, and rms over all [g], one standard deviation.

    `direction` is the vertical of the worst pose in the axes of the accelerometers; `words` grades the error.
    """

    worst: Size = Field(alias="worst_g")
    rms: Size = Field(alias="rms_g")
    direction: Direction
    words: str


class TurnError(Part):
    """Predicted error of a turn of 90° about the worst axis [rad], one standard deviation."""

    worst: Size = Field(alias="worst_rad")
    axis: Direction


class TakenSensitivity(Part):
    """F test of the gyros' sensitivity to gravity: `f`, its probability `p`, and whether it is taken."""

    f: Number
    p: Probability
    taken: bool


class Case(Part):
    """Rotation of inputs into the axes of the case, known by faces, and its standard error [rad]."""

    rotation: Rotation
    standard_error: Size = Field(alias="standard_error_rad")


class HandGain(Part):
    """Errors of rests and moves that were not used, five contiguous parts in turn, as read and as calibrated (rms).

    Of rests the norm of gravity [g], of moves, or windows with a true attitude, the carried direction [rad].
    """

    rest_before: Size | None = Field(default=None, alias="rest_before_g")
    rest_after: Size | None = Field(default=None, alias="rest_after_g")
    move_before: Size | None = Field(default=None, alias="move_before_rad")
    move_after: Size | None = Field(default=None, alias="move_after_rad")


class PooledTest(Part):
    """F test whether several runs are of one instrument: its value `f`, the probability `p` of a larger one by chance,
    and the answer. `growth` is that of the residuals' rms when the runs are pooled."""

    f: Number
    p: Probability
    growth: Size
    one_instrument: bool


class ByHand(Part):
    """Basis of a calibration without a table.

    Attributes
    ----------
    rests, moves, turns : int
        that are used
    pose_error : PoseError
    turn_error : TurnError or None
        None without gyros
    residual_norm : float
        rms of the norms at rest [g]
    residual_move, largest_move : float or None
        rms of the moves, or of windows with a true attitude, and the largest [rad]: with such a bound the gyros stand
    axes : str
        those of the gyros' matrix: "accelerometers", or "true attitude" where nothing ties these together
    sensitivity : TakenSensitivity or None
    case : Case or None
        None where no faces are known
    gain : HandGain or None
        None of too few rests
    pooled : PooledTest or None
        of several records
    scatter_limit : float or None
        scatter of an accelerometer at rest, over its noise, up to which rests are found; None of rests that are given
    covariance : list of 9 lists
        of gamma_11, gamma_21, gamma_22, gamma_31, gamma_32, gamma_33 [1] and bias_1, bias_2, bias_3 [g], with the prior
    turn_covariance : list of 9 lists or None
        of M11, M12 to M33 [1], with the prior; None without gyros
    """

    omitted: ClassVar[frozenset[str]] = frozenset(
        {"scatter_limit", "gain", "pooled", "largest_rad", "covariance", "turn_covariance"}
    )

    rests: Count
    moves: Count = 0
    turns: Count = 0
    pose_error: PoseError
    turn_error: TurnError | None = None
    residual_norm: Size = Field(alias="residual_g")
    residual_move: Size | None = Field(default=None, alias="residual_rad")
    largest_move: Size | None = Field(default=None, alias="largest_rad")
    axes: Literal["accelerometers", "true attitude"] = "accelerometers"
    sensitivity: TakenSensitivity | None = None
    case: Case | None = None
    gain: HandGain | None = None
    pooled: PooledTest | None = None
    scatter_limit: Size | None = None
    covariance: Covariance | None = None
    turn_covariance: Covariance | None = None


def noise_option(bound: float | None) -> str:
    """Return the option of a noise bound [g], rounded upwards; empty of none that can be given."""
    return f"--noise-bound {upwards(bound, 3)}" if bound is not None and 0.0 < bound < 1.0 else ""


class SetOfEffects(Part):
    """Effects of one of several explanations, in words, and the least σ with which the model stands with them.

    `option` is σ as an option of the command line; both are empty where other bounds than σ count.
    """

    effects: list[str]
    stands_with_sigma: Size | None = None
    option: str = ""


class CalibratedEffect(Part):
    """An effect that was calibrated with the model's parameters: in words, where it acts, its own parameters."""

    effect: str
    where: str
    parameters: list[Parameter]

    @property
    def in_readings(self) -> bool:
        """Return true if an accelerometer reads the parameter; false for parameters of the table or of one reading."""
        return self.where.startswith("accelerometer")


class TablePosition(TypedDict):
    """Angles of the table, and the mounting where there are several."""

    alpha_deg: Number
    beta_deg: Number
    mounting: NotRequired[str]


class OfRecord(Part):
    """Values of one of several records that only this record has."""

    omitted: ClassVar[frozenset[str]] = frozenset({"by_hand"})

    sigma: Sigma
    mountings: dict[str, Rotation] = Field(default={})
    parameters: list[Parameter] = Field(default=[])
    reading_errors: list[ReadingError] = Field(default=[])
    by_hand: ByHand | None = None
    provenance: Provenance


class ParameterChange(Part):
    """Change of a parameter between several records, each calibrated by itself.

    Attributes
    ----------
    symbol, unit : str
    of : str
        "instrument", or "run" where each record has its own
    at_least, at_most : float or None
        it changes by `at_least` surely between two of the records; by `at_most` over all of them, None where one leaves
        it open
    since, beside : str or None
        the first record with which no constant explains the parameter, and one before that excludes it
    """

    symbol: str
    unit: str
    of: Literal["instrument", "run"]
    at_least: Size
    at_most: Size | None
    since: str | None
    beside: str | None


class Calibration(Part):
    """Result of a calibration: the parameters of a model, from one or several records.

    Attributes
    ----------
    verdict : str
        "consistent", "falsified" (no parameters keep every reading within its bound), "insufficient", or
        "noise-unknown": nothing is guaranteed, as nothing says how large the errors are; `sigma.find` says how to know.
        Without a table, where σ is not a bound: "usable", if the predicted error of an unseen pose is small
    sigma : Sigma
    stands_with_sigma : float or None
        the least σ with which the model stands, where all bounds grow with it
    radius : float or None
        least max |z − f(X)| / bound
    gravity : float
        [m/s²]; None where it is not asked for
    convention, baseline : str or None
        "A1" or "A2"; "asymmetric" or "symmetric"
    mountings : dict
        Q by name
    positions, measurements : int or None
        N and M
    estimator : str or None
        kind of estimate: "analytic centre"; "central programme", where the possible parameters have no interior; "least
        squares" of a falsified model; "a priori" in files of schema trihedron.calibration/1
    no_estimate : str
        why nothing, or not everything, is bounded
    witness : list of Reading
        the readings that prove a falsification
    parameters : list of Parameter
        those of the bench and the accelerometers, then those of the gyros; of several records the shared ones
    priors : list of KnownBefore
    gyros : Gyros or None
        of a bench record whose place is known; then all numbers are of readings and turns together
    by_hand : ByHand or None
        of a calibration without a table
    effects : list of CalibratedEffect
        effects that a diagnosis names and whose sizes are unknowns of the same programme; all numbers hold beside them
    explained_by : str
        the diagnosis that names them
    sets : list of SetOfEffects
        of an ambiguous diagnosis: sets of effects each of which explains the record. The intervals hold with any of
        them; the estimates are those of the first
    reading_errors : list of ReadingError
        possible errors of the readings at the corners of the input
    open : list of Open
        directions that the records leave undetermined
    next_positions : list of TablePosition
        table positions that would determine them
    of_record : dict of OfRecord
        of several records, by label
    changes : list of ParameterChange
        of records each of which is calibrated by itself: the parameters that differ between them
    provenance : Provenance or None
        None of several records: each has its own
    warnings : list of str
    linearised : Linearisation
        the fit; not published
    feasible : FeasibleSet or None
        not published; None where the measurements contradict the model
    made_of : record
        not published
    """

    omitted: ClassVar[frozenset[str]] = frozenset(
        {"stands_with_sigma", "gravity_mps2", "convention", "baseline", "mountings", "positions", "measurements"}
        | {"no_estimate", "gyros", "reading_errors", "open", "next_positions", "of_record", "changes", "provenance"}
        | {"effects", "explained_by", "sets", "by_hand"}
    )

    schema_: Literal["trihedron.calibration/3"] = Field(default="trihedron.calibration/3", alias="schema")
    verdict: Verdict
    sigma: Sigma
    stands_with_sigma: Size | None = None
    radius: Size | None
    gravity: Annotated[float, Field(ge=GRAVITIES[0], le=GRAVITIES[1])] = Field(default=ABSENT, alias="gravity_mps2")
    convention: Literal["A1", "A2"] | None = None
    baseline: Literal["asymmetric", "symmetric"] | None = None
    mountings: dict[str, Rotation] = Field(default={})
    positions: Count | None = None
    measurements: Count | None = None
    estimator: Estimator | None
    no_estimate: str = ""
    witness: list[Reading] = Field(default=[])
    parameters: list[Parameter]
    units: dict[str, str] = UNITS
    priors: list[KnownBefore] = Field(default=[])
    gyros: Gyros | None = None
    by_hand: ByHand | None = None
    effects: list[CalibratedEffect] = Field(default=[])
    explained_by: str = ""
    sets: list[SetOfEffects] = Field(default=[])
    reading_errors: list[ReadingError] = Field(default=[])
    open: list[Open] = Field(default=[])
    next_positions: list[TablePosition] = Field(default=[])
    of_record: dict[str, OfRecord] = Field(default={})
    changes: list[ParameterChange] = Field(default=[])
    provenance: Provenance | None = None
    warnings: list[str] = Field(default=[])
    linearised: Any = Field(default=None, exclude=True)
    feasible: Any = Field(default=None, exclude=True)
    made_of: Any = Field(default=None, exclude=True)

    @model_validator(mode="before")
    @classmethod
    def _of_former_schemas(cls, content: Any) -> Any:
        return calibration_of(content) if isinstance(content, Mapping) and "schema" in content else content

    @property
    def stands(self) -> bool:
        """Return true if the model keeps every reading within its bound, even where σ is unknown."""
        return gives_parameters(self.verdict, self.estimator)

    @property
    def option_to_stand(self) -> str:
        """The option with which a falsified model would stand; empty where it stands, or other bounds than σ count."""
        return noise_option(self.stands_with_sigma) if self.verdict == "falsified" else ""

    @property
    def noise_bound(self) -> float:
        """σ as a fraction of g; NaN where there are several."""
        return float("nan") if self.sigma.value is None else self.sigma.value

    @property
    def targets(self) -> list[Parameter]:
        """The parameters of the bench and the accelerometers."""
        return [p for p in self.parameters if p.symbol not in OF_GYROS]

    @property
    def of_gyros(self) -> list[Parameter]:
        """The parameters of the gyros, and the latencies."""
        return [p for p in self.parameters if p.symbol in OF_GYROS]

    @property
    def missing(self) -> list[Parameter]:
        """The parameters of the bench and the accelerometers that the records do not determine."""
        return [p for p in self.targets if not p.determined]

    def each(self, symbol: str) -> dict[str, Parameter]:
        """Return a parameter as each record tells it by itself, by the labels of those that do."""
        by_label = {}
        for label, record in self.of_record.items():
            for p in record.parameters:
                if p.symbol == symbol:
                    by_label[label] = p
        return by_label

    def __getitem__(self, target: str) -> Parameter:
        """Return a parameter by its symbol, as X4, or its name, as bias-1; a ValueError where there is none."""
        for p in self.parameters:
            if target in (p.symbol, p.name):
                return p
        symbols = [p.symbol for p in self.parameters]
        raise InvalidInput(f"{target}: no target of this calibration; {nearest(target, symbols)}")

    def get(self, target: str, default: Any = None) -> Any:
        """Return a parameter by its symbol or its name, or `default` where there is none."""
        for p in self.parameters:
            if target in (p.symbol, p.name):
                return p
        return default

    def __contains__(self, target: object) -> bool:
        """Return true if a parameter has this symbol or name."""
        return any(target in (p.symbol, p.name) for p in self.parameters)

    def __iter__(self) -> Iterator[str]:  # type: ignore[override]
        """Go through the symbols of the parameters."""
        return iter([p.symbol for p in self.parameters])

    def sheet(self, path: str | Path, *, about: Mapping[str, str] | None = None, record: Any = None) -> Path:
        """Write one A4 page to sign: people, numbers, correction, and the evidence behind them.

        Parameters
        ----------
        path : path
            .html, or .pdf
        about : mapping, optional
            serial number, operator, bench, date, temperature; they count before those of the record's comment lines
        record : PositionRecord, optional
            Source of the result, where it came from a file.

        Raises
        ------
        InputError
            where the file cannot be written, or the page not be printed
        """
        self._shown("sheet", Path(path), record, about)
        return Path(path)

    def to_polars(self) -> "DataFrame":
        """Return a row for each parameter, with the fields of `Parameter` and its error bound."""
        import polars as pl

        rows = [p.to_json() | {"error_bound": p.error_bound} for p in self.parameters]
        return pl.DataFrame(rows, schema_overrides=dict.fromkeys((*NUMBERS, "error_bound"), pl.Float64))


def each_by_itself(
    records: Mapping[str, OfRecord], is_of_instrument: Callable[[str], bool], provenance: Provenance | None = None
) -> Calibration:
    """Return what several records say, each by itself, and what changes between them.

    It is falsified where a parameter of the instrument is no constant. Of `is_of_instrument` symbols are asked.
    """
    symbols: dict[str, str] = {}
    for record in records.values():
        symbols |= {p.symbol: p.unit for p in record.parameters}
    alone = Calibration(
        verdict="consistent",
        sigma=EACH_ITS_OWN,
        radius=None,
        estimator=None,
        parameters=[],
        of_record=dict(records),
        provenance=provenance,
    )
    changes = []
    for symbol, unit in symbols.items():
        intervals = {label: p.ends for label, p in alone.each(symbol).items()}
        lows, highs = zip(*intervals.values(), strict=True)
        since, beside = first_falsified(intervals)
        changes.append(
            ParameterChange(
                symbol=symbol,
                unit=unit,
                of="instrument" if is_of_instrument(symbol) else "run",
                at_least=max(0.0, max(lows) - min(highs)),
                at_most=finite_or_none(max(highs) - min(lows)),
                since=since,
                beside=beside,
            )
        )
    verdict = "consistent"
    if any(change.of == "instrument" and change.since is not None for change in changes):
        verdict = "falsified"
    return alone.model_copy(update={"verdict": verdict, "changes": changes})


def first_falsified(intervals: Mapping[str, tuple[float, float]]) -> tuple[str | None, str | None]:
    """Return the first label at which no constant lies in all intervals so far, and one before that excludes it."""
    labels = list(intervals)
    for number, later in enumerate(labels):
        least, most = intervals[later]
        for earlier in labels[:number]:
            low, high = intervals[earlier]
            if least > high or most < low:
                return later, earlier
    return None, None
