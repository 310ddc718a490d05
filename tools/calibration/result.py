"""What a calibration found: its published object, and what a file of it gives back."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NotRequired

from pydantic import ConfigDict, Field, model_serializer, model_validator
from typing_extensions import TypedDict

from ...fmus import version
from ...fmus.parameters import CALIBRATION, FIRST_SCHEMA, GRAVITIES
from ..errors import InputError, nearest
from ..result import Result
from .estimates import FeasibleSet
from .model import Linearisation

if TYPE_CHECKING:
    from polars import DataFrame

Number = Annotated[float, Field(allow_inf_nan=False)]
Size = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0)]
Accelerometer = Annotated[int, Field(ge=1, le=3)]
NUMBERS = (
    *("estimate", "error_bound", "low", "high", "a_priori", "guaranteed_error"),
    *("least_squares", "standard_error"),
)
SINCE_SECOND = ("error_bound", "least_squares", "standard_error")
"""Numbers that a target has since schema trihedron.calibration/2."""
UNITS_OF_RESULT = {
    "noise_bound": "g",
    "gravity_mps2": "m/s2",
    "radius": "1",
    "parameters": "of all numbers of a target: as its unit says",
    "reading_errors": "g",
}
"""Units of the numbers of the published object; g is its own `gravity_mps2`."""


class _Part(Result):
    model_config = ConfigDict(strict=True)


class Reading(_Part):
    """A reading that proves something: the record's number of its position, and the accelerometer."""

    position: Annotated[int, Field(ge=1)]
    accelerometer: Accelerometer


class Estimate(_Part):
    """One target's value: the central estimate, and beside it what else is said of it.

    Attributes
    ----------
    symbol, name, unit : str
        as the paper writes it, in words, and its unit
    estimate : float or None
        of the one possible point that the calibration states; None where the measurements leave the target unbounded,
        and everywhere where they falsify the model
    error_bound : float or None
        a posteriori: how far the estimate may be from the truth, the greater distance from an end of its interval
    low, high : float or None
        the exact ends of what the measurements leave possible; None where they falsify the model
    a_priori, guaranteed_error : float or None
        by the weights of the linear programme, which are best before anything is read, and what that is never wrong by
        more than: σ times the l1 norm of the weights; None where the measurements cannot determine it. The readings may
        prove the a-priori estimate itself impossible.
    least_squares, standard_error : float or None
        as practitioners do it: the fit of the exact model, and its error from the scatter of the residuals; None where
        the measurements cannot determine it, and a standard error where they leave no freedom
    """

    symbol: str
    name: str
    unit: str
    estimate: Number | None
    error_bound: Size | None
    low: Number | None
    high: Number | None
    a_priori: Number | None
    guaranteed_error: Size | None
    least_squares: Number | None
    standard_error: Size | None

    @model_validator(mode="after")
    def _ordered(self) -> "Estimate":
        if self.low is not None and self.high is not None and self.low > self.high:
            raise ValueError(f"low = {self.low!r} is above high = {self.high!r}")
        return self

    def possible(self, value: float | None) -> bool:
        """Whether a value is within the interval, as far as there are both."""
        return value is None or self.low is None or self.high is None or self.low <= value <= self.high


class ReadingError(_Part):
    """What an accelerometer reads beyond its input [g] at that input (3,) [g], at least and at most.

    None where the readings do not determine it.
    """

    accelerometer: Accelerometer
    input: list[int]
    low: Number | None
    high: Number | None


class OpenTarget(_Part):
    """A target that the measurements cannot determine."""

    symbol: str
    name: str


class Gain(_Part):
    """What turns add: a target's guaranteed error by the accelerometers alone, and by both."""

    symbol: str
    accelerometers_alone: Size
    with_gyros: Size


class Turn(_Part):
    """A piece that proves something: its gyro, from 1, and when it begins and ends [s]."""

    gyro: Accelerometer
    from_s: Number
    to_s: Number


class GyroCalibration(_Part):
    """The gyros of a bench record, in the accelerometers' axes.

    Attributes
    ----------
    pieces : int
        rests, moves and parts of moves over which the gyros are integrated
    noise_basis : str
        what the bounds of the gyros' noise rest on
    encoder_bound : float
        of an encoder's error [rad]
    latitude_deg, azimuth_deg : float
        where the bench stands, and the outer axis points, from north towards east
    parameters : list of Estimate
        biases B, scale factors and misalignments M, sensitivities to specific force S, lag behind the encoders L; the
        accelerometers' lag A, by what they read in motion, and the gyros' behind them, L-A
    missing : list of OpenTarget
        what the record does not determine
    gains : list of Gain
        targets of the bench that are known better by the turns
    witness : list of Turn
        the pieces that prove a falsification
    """

    pieces: Count
    noise_basis: str
    encoder_bound: Size = Field(alias="encoder_bound_rad")
    latitude_deg: Number
    azimuth_deg: Number
    parameters: list[Estimate]
    missing: list[OpenTarget]
    gains: list[Gain]
    witness: list[Turn]


class KnownBefore(_Part):
    """A prior, |expression| ≤ limit."""

    expression: str
    limit: Number


class Provenance(_Part):
    """What a calibration was made from: the record's file and its SHA-256 (empty without a file), bounds of (1.7)."""

    trihedron: str = Field(default_factory=version)
    record: str
    sha256: str = Field(alias="record_sha256")
    bounds: list[Number]


class TablePosition(TypedDict):
    """Angles of the table, and the mounting where there are several."""

    alpha_deg: Number
    beta_deg: Number
    mounting: NotRequired[str]


class Calibration(_Part):
    """A calibration of the bench.

    Attributes
    ----------
    verdict : str
        "consistent", "falsified" or "insufficient"
    noise_bound, noise_bound_basis
        σ as a fraction of g, and on what it rests
    gravity : float
        [m/s²]
    convention, baseline : str
        "A1" or "A2"; "asymmetric" or "symmetric"
    mountings : dict
        Q by name
    positions, measurements : int
        N and M
    radius : float
        least max |z − f(X)| / bound
    estimator : str or None
        what `estimate` of the parameters is: "analytic centre", "central programme" where the possible parameters have
        no interior, or "a priori" where the result was read from a file of schema trihedron.calibration/1
    no_estimate : str
        why there is no estimate, or none of some targets; empty where there are all
    witness : list of Reading
        the measurements that prove a falsification
    parameters : list of Estimate
    units : dict
        of the numbers here
    priors : list of KnownBefore
    gyros : GyroCalibration or None
        of a bench record, where it was asked for; then all numbers here are of readings and turns together
    reading_errors : list of ReadingError
        what the readings may be off by at the corners of the input
    provenance : Provenance or None
    missing : list of OpenTarget
        what the measurements cannot determine
    next_positions : list of TablePosition
        table positions that would determine it
    warnings : list of str
    linearised : Linearisation
        the fit, for the diagnosis; not published
    feasible : FeasibleSet or None
        not published; None where the measurements contradict the model
    """

    schema_: Literal["trihedron.calibration/2"] = Field(default="trihedron.calibration/2", alias="schema")
    verdict: Literal["consistent", "falsified", "insufficient"]
    noise_bound: Annotated[float, Field(gt=0.0, lt=1.0)]
    noise_bound_basis: str = ""
    gravity: Annotated[float, Field(ge=GRAVITIES[0], le=GRAVITIES[1])] = Field(alias="gravity_mps2")
    convention: Literal["A1", "A2"]
    baseline: Literal["asymmetric", "symmetric"]
    mountings: dict[str, list[list[Number]]] = Field(default={})
    positions: Count
    measurements: Count
    radius: Size
    estimator: Literal["analytic centre", "central programme", "a priori"] | None
    no_estimate: str = ""
    witness: list[Reading]
    parameters: Annotated[list[Estimate], Field(min_length=1)]
    units: dict[str, str] = UNITS_OF_RESULT
    priors: list[KnownBefore] = Field(default=[])
    gyros: GyroCalibration | None = None
    reading_errors: list[ReadingError] = Field(default=[])
    provenance: Provenance | None = None
    missing: list[OpenTarget] = Field(default=[])
    next_positions: list[TablePosition] = Field(default=[])
    warnings: list[str] = Field(default=[])
    linearised: Linearisation = Field(default=None, exclude=True)  # pyright: ignore[reportAssignmentType]
    feasible: FeasibleSet | None = Field(default=None, exclude=True)
    made_of: Any = Field(default=None, exclude=True)

    @model_validator(mode="before")
    @classmethod
    def _of_first_schema(cls, content: Any) -> Any:
        """What a file of schema trihedron.calibration/1 says: its estimates are the a-priori ones."""
        if not isinstance(content, dict) or content.get("schema") != FIRST_SCHEMA:
            return content
        parameters = content.get("parameters")
        if isinstance(parameters, list):
            parameters = [_of_first(entry) if isinstance(entry, dict) else entry for entry in parameters]
        return {**content, "schema": CALIBRATION, "estimator": "a priori", "parameters": parameters}

    @model_serializer(mode="wrap")
    def _without_what_is_empty(self, handler: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        content = handler(self)
        absent = {name for name in ("provenance", "gyros") if getattr(self, name) is None}
        if self.verdict != "insufficient":
            absent |= {"missing", "next_positions"}
        return {key: value for key, value in content.items() if key not in absent}

    def __getitem__(self, target: str) -> Estimate:
        """A target by its symbol, as X4, or its name, as bias-1; an InputError where there is none."""
        found = next((e for e in self.parameters if target in (e.symbol, e.name)), None)
        if found is None:
            raise InputError(
                f"{target}: no target of this calibration; {nearest(target, [e.symbol for e in self.parameters])}"
            )
        return found

    def sheet(self, path: str | Path, *, about: Mapping[str, str] | None = None, record: Any = None) -> Path:
        """Write one A4 page to sign: who measured what, the numbers, the correction, what they rest on.

        Parameters
        ----------
        path : path
            .html, or .pdf
        about : mapping, optional
            serial number, operator, bench, date, temperature, before what the record's comment lines say
        record : PositionRecord, optional
            What the result was made from, where it came from a file.

        Raises
        ------
        InputError
            where the file cannot be written, or the page not be printed
        """
        self._shown("sheet", Path(path), record, about)
        return Path(path)

    def to_polars(self) -> "DataFrame":
        """A row for each target, with the fields of `Estimate`."""
        import polars as pl

        numbers: Any = dict.fromkeys(NUMBERS, pl.Float64)
        return pl.DataFrame([e.to_json() for e in self.parameters], schema_overrides=numbers)


def _of_first(entry: dict[str, Any]) -> dict[str, Any]:
    """A target as the first schema wrote it."""
    return {"a_priori": entry.get("estimate"), **dict.fromkeys(SINCE_SECOND), **entry}
