"""Kinds of records that can be diagnosed: the evidence of each, and the options that it has."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import ArrayLike

from ...models.effects import EffectPlace
from ..calibration.gyros import BenchOnEarth as Place
from ..errors import InputError
from ..evidence.bench import bench_evidence
from ..evidence.bench_in_motion import whole_evidence
from ..evidence.carried_record import carried_evidence
from ..evidence.carried_run import LONG
from ..evidence.evidence import Evidence
from ..evidence.known_directions import KnownDirections, directions_evidence
from ..records import PositionRecord, StrapdownRecord
from ..room import FEWER_POSITIONS, Room

BOUNDS = (3e-3, 1e-2)


@dataclass(frozen=True)
class DiagnosisOptions:
    """Options of a diagnosis as a person gives them, for any kind of record.

    `positions` are those of all records that are taken together.
    """

    noise_bound: float | None = None
    noise_sd: float | None = None
    gravity: float = 9.80665
    baseline: str | None = None
    bounds: tuple[float, float] = BOUNDS
    mounting: str | Mapping[str, ArrayLike] = "identity"
    rates: str = "instantaneous"
    reference_bound: float | None = None
    bench: Place | None = None
    positions: int | None = None


@dataclass(frozen=True)
class Kind:
    """A kind of record.

    Attributes
    ----------
    evidence : callable
        the evidence of a record, with options
    options : callable
        the options of its evidence by parameter; an InputError for an option that the kind does not have
    own : tuple of str
        names of options that no other kind has
    baselines : tuple of str
    at_table : bool
        true if a table turns the block
    runs_formulas : bool
        true if formulas run beside the catalogue; else they can be added to evidence at any time
    """

    evidence: Callable[..., Evidence]
    options: Callable[[Any, DiagnosisOptions], dict[str, Any]]
    own: tuple[str, ...]
    baselines: tuple[str, ...]
    at_table: bool
    runs_formulas: bool

    def shared_options(self, options: DiagnosisOptions) -> DiagnosisOptions:
        """Return the options that concern this kind of record; those of other kinds take their defaults."""
        default = DiagnosisOptions()
        changed: dict[str, Any] = {}
        for kind in KINDS.values():
            if kind is self:
                continue
            for name in kind.own:
                changed[name] = getattr(default, name)
            if options.baseline in kind.baselines:
                changed["baseline"] = None
        return replace(options, **changed)


def evidence_of(record: PositionRecord | StrapdownRecord | KnownDirections, **options: Any) -> Evidence:
    """The evidence of a record.

    Options are as for `bench_evidence` or `carried_evidence`. `bench` says where a bench record was measured: then its
    gyros are held against the table, too.
    """
    return kind_of(record).evidence(record, **options)


def check_room(*records: PositionRecord | StrapdownRecord) -> None:
    """Raise an InputError for records whose diagnosis together needs more memory than the budget."""
    rooms: Mapping[type, Room] = {PositionRecord: OF_POSITIONS, StrapdownRecord: OF_STRAPDOWN}
    for kind, room in rooms.items():
        alike = [record for record in records if isinstance(record, kind)]
        if alike:
            room.check(sum(map(len, alike)), ", ".join(str(record.path) for record in alike))


def evidence_options(record: Any, *, among: Mapping[str, Any] | None = None, **options: Any) -> dict[str, Any]:
    """Return the evidence options of a record from those of `diagnose`, the fields of `DiagnosisOptions`.

    `among` are the records with which it is diagnosed: of two kinds each has the options that are its own. An
    InputError for an option that the record's kind does not have.
    """
    kind, asking = kind_of(record), DiagnosisOptions(**options)
    if any(kind_of(further) is not kind for further in (among or {}).values()):
        asking = kind.shared_options(asking)
    if among is not None:
        positions = sum(len(further) for further in among.values() if isinstance(further, PositionRecord))
        asking = replace(asking, positions=positions)
    return kind.options(record, asking)


def evidence_with_formulas(
    record: PositionRecord | StrapdownRecord | KnownDirections,
    evidence: Evidence,
    formulas: Sequence[EffectPlace],
    **options: Any,
) -> Evidence:
    """The evidence of a record in which formulas can be tried.

    An InputError for a formula that needs data the record lacks, or that is not finite at one of its rows.
    """
    if not formulas or evidence.reader.missing():
        return evidence
    try:
        if kind_of(record).runs_formulas:
            evidence = kind_of(record).evidence(record, further=formulas, **options)
        for place in formulas:
            evidence.rows.columns_of([place])
    except ValueError as error:
        raise InputError(f"{record.path}: --hypothesis {error}") from error
    return evidence


def kind_of(record: PositionRecord | StrapdownRecord | KnownDirections) -> Kind:
    """The kind of a record."""
    return KINDS[type(record)]


def _evidence_at_table(record: PositionRecord, *, bench: Place | None = None, **options: Any) -> Evidence:
    return bench_evidence(record, **options) if bench is None else whole_evidence(record, bench, **options)


def _options_at_table(record: PositionRecord, asking: DiagnosisOptions) -> dict[str, Any]:
    if asking.rates != "instantaneous" and asking.bench is None:
        raise InputError(f"--rates {asking.rates}: is of a strapdown record; a record of a table has no rates")
    if asking.reference_bound is not None:
        raise InputError(
            f"--reference-bound {asking.reference_bound:g}: is of a strapdown record; a record of a table has no true "
            "attitude"
        )
    options: dict[str, Any] = {"gravity": asking.gravity, "noise_bound": asking.noise_bound, "bounds": asking.bounds}
    options |= {"mounting": asking.mounting, "baseline": asking.baseline or "asymmetric"}
    options |= {"noise_sd": asking.noise_sd, "positions": asking.positions}
    if asking.bench is not None:
        options["bench"] = replace(asking.bench, rates=asking.rates)
    return options


def _options_carried(record: StrapdownRecord, asking: DiagnosisOptions) -> dict[str, Any]:
    if (asking.noise_bound, asking.noise_sd, asking.bounds, asking.mounting) != (None, None, BOUNDS, "identity"):
        raise InputError(
            f"{record.path}: of a strapdown record noise_bound, noise_sd, bounds and mounting have no meaning"
        )
    if asking.bench is not None:
        raise InputError(f"--latitude-deg: is of a bench record; {record.path} is a strapdown record")
    return {name: getattr(asking, name) for name in ("gravity", "baseline", "rates", "reference_bound")}


OF_POSITIONS = Room("a diagnosis", "positions", FEWER_POSITIONS, 2.4e8, 2.1e5, 206.0)
OF_STRAPDOWN = Room("a diagnosis", "rows", "cut the record", 3.3e8, 2500.0, long=LONG, of_long=500.0)
KINDS: Mapping[type, Kind] = {
    PositionRecord: Kind(
        evidence=_evidence_at_table,
        options=_options_at_table,
        own=("noise_bound", "noise_sd", "bounds", "mounting"),
        baselines=("asymmetric", "symmetric"),
        at_table=True,
        runs_formulas=False,
    ),
    StrapdownRecord: Kind(
        evidence=carried_evidence,
        options=_options_carried,
        own=("rates", "reference_bound"),
        baselines=("calibrated", "nominal"),
        at_table=False,
        runs_formulas=True,
    ),
    KnownDirections: Kind(
        evidence=directions_evidence,
        options=lambda record, asked: {},
        own=(),
        baselines=(),
        at_table=False,
        runs_formulas=False,
    ),
}
