"""A record calibrated with the faults that a diagnosis names: wrong rows left out, breaks and effects as further
unknowns."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models.effects import EffectPlace
from ...models.effects.last_stage import place_of
from ..bounded.programmes import SolverError
from ..bounded.work import Work
from ..calibrated import Calibration, Sigma
from ..calibration.calibration import Asked, without_guarantee
from ..calibration.gyros import BenchOnEarth as Place
from ..calibration.gyros import calibrate_whole
from ..errors import InputError, one_line
from ..evidence.bench import bench_evidence
from ..evidence.evidence import Evidence
from ..evidence.observation import acts_at_rest
from ..records import PositionRecord, StrapdownRecord
from ..records.columns import CORRECTED_BY, CORRECTED_WITHIN
from ..rounding import exactly
from .any_of_several import Way, explanations_to_use, with_any_of
from .applied import of_the_record, origin_of
from .cause import Cause, centred
from .kinds import evidence_of, evidence_options
from .result import Diagnosis, Explanation
from .with_effects import Named, Programme, effects_of_fit, either_effects, either_parameters, solve_with

WRITTEN = ("formula", "lookup")
"""Effects that are in no catalogue: a law or a table as a diagnosis writes it."""
LEAST_NEEDED = "the least with which the model stands, by the diagnosis"


def calibrated_with(
    diagnosis: Diagnosis, record: PositionRecord | StrapdownRecord, place: Place | None = None, **options: Any
) -> Calibration:
    """Calibrate a record with the faults that a diagnosis names.

    Wrong rows are left out. A larger noise bound counts. Breaks and effects are solved in one programme with the
    parameters. If the diagnosis is of this record, the sizes of the effects are unknown. If it is of another record of
    the same instrument, its intervals bound them; rows and breaks of that record do not count. Options are the fields
    of `Asked`; the noise bound defaults to that of the diagnosis. With the place of a bench the gyros of its record are
    calibrated, too. With an ambiguous diagnosis the intervals hold with any explanation that remains. An InputError for
    a diagnosis that names nothing, or for effects that the record cannot have.
    """
    _refuse_corrected(record)
    chosen = explanations_to_use(diagnosis, options.get("noise_bound"))
    ways, refusals = [], []
    for one in chosen:
        try:
            ways.append(Way(one, _calibrated(Given(one, record, place, options))))
        except InputError as error:
            refusals.append(str(error))
    if not ways:
        raise InputError(refusals[0])
    if len(chosen) == 1 and diagnosis.verdict == "explained":
        return ways[0].calibration
    return with_any_of(ways, diagnosis, refusals)


def _calibrated(given: "Given") -> Calibration:
    """Return the calibration with the faults of one explanation."""
    try:
        calibration = given.calibration()
    except SolverError as error:
        raise InputError(f"{given.record.path}: {error}; is the noise bound right?") from error
    warnings = [*given.warnings(), *calibration.warnings]
    return calibration.model_copy(update={"explained_by": origin_of(given.diagnosis), "warnings": warnings})


def _refuse_corrected(record: PositionRecord | StrapdownRecord) -> None:
    for line in (CORRECTED_WITHIN, CORRECTED_BY):
        if line in record.about:
            raise InputError(
                f"{record.path}: is corrected already ({record.about.get(CORRECTED_BY)}); give --with the record as "
                "it was measured"
            )


def is_of(diagnosis: Diagnosis, record: PositionRecord | StrapdownRecord) -> bool:
    """Return true if a diagnosis was made from this record."""
    if diagnosis.made_of is record:
        return True
    source = diagnosis.calibration.provenance
    digest = source.sha256 if source is not None else ""
    if diagnosis.record is not None:
        digest = diagnosis.record.sha256
    return digest != "" and digest == record.sha256


@dataclass(frozen=True)
class Given:
    """A diagnosis, a record that is calibrated with it, the place of its bench, and the options of `Asked`."""

    diagnosis: Diagnosis
    record: PositionRecord | StrapdownRecord
    place: Place | None
    options: dict[str, Any]

    @property
    def is_same(self) -> bool:
        """Return true if the diagnosis is of this record."""
        return is_of(self.diagnosis, self.record)

    @property
    def explanation(self) -> Explanation | None:
        """The named explanation of this record; None for another record, or a diagnosis of several."""
        return self.diagnosis.best if self.is_same and not self.diagnosis.records else None

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The named effects that act in this record; an InputError for one that only the diagnosed record has."""
        causes = self.diagnosis.causes_in(self.record.sha256)
        for cause in causes:
            if not self.is_same and (cause.effect == "outlier" or not cause.place.definition.linear):
                raise InputError(
                    f"--with: {cause.place.title} is of the record that was diagnosed, and {self.record.path} is "
                    "another one; diagnose it"
                )
        return causes

    @property
    def wrong_rows(self) -> tuple[int, ...]:
        """Numbers of the rows that are left out; none where single readings are wrong."""
        named = self.explanation
        if named is None or any(cause.effect == "outlier" for cause in named.causes):
            return ()
        known = self.record.numbers if isinstance(self.record, PositionRecord) else ()
        for row in named.rows or ():
            if row not in known:
                raise InputError(f"--with: the diagnosis names row {row}, which {self.record.path} does not have")
        return named.rows or ()

    @property
    def changes(self) -> tuple[tuple[str, ...], ...]:
        """Keys of the parts that change at each break."""
        named = self.explanation
        if named is None or named.kind != "break":
            return ()
        by_row: dict[str, list[str]] = {}
        for key in named.change or {}:
            part, _, row = key.partition("_from_")
            by_row.setdefault(row, []).append(part)
        return tuple(tuple(parts) for parts in by_row.values())

    @property
    def at_rest(self) -> tuple[Cause, ...]:
        """The effects that act at rest."""
        return tuple(cause for cause in self.causes if acts_at_rest(cause.place))

    @property
    def has_noise(self) -> bool:
        """Return true if a person gives the noise."""
        return self.options.get("noise_bound") is not None or self.options.get("noise_sd") is not None

    @property
    def names_sigma(self) -> bool:
        """Return true if the diagnosis names a larger noise bound."""
        named = None if self.diagnosis.records else self.diagnosis.best
        return named is not None and named.kind == "sigma"

    @property
    def sigma_needed(self) -> float | None:
        """The larger noise bound that the diagnosis names; None where it names none, or a person gives one."""
        if not self.names_sigma or self.has_noise or self.diagnosis.best is None:
            return None
        bound = (self.diagnosis.best.change or {}).get("noise_bound")
        if not isinstance(bound, int | float) or isinstance(bound, bool) or not 0.0 < bound < 1.0:
            raise InputError(
                f"--with: the diagnosis names a larger noise bound, and its value is {bound!r}; diagnose again"
            )
        return float(bound)

    def request(self) -> Asked:
        """Return the options with the noise bound of the diagnosis where a person gives none."""
        if self.has_noise:
            return Asked(**self.options)
        bound = self.sigma_needed or self.diagnosis.noise_bound
        if bound is None:
            raise InputError("--with: the diagnosis has no noise bound of readings; give --noise-bound, as 1e-5")
        return Asked(**{**self.options, "noise_bound": bound, "noise_sd": None})

    def sigma(self, used: Sigma) -> Sigma:
        """Return σ as it was used: a bound where σ of the diagnosis, from which it or sizes are taken, is one."""
        if self.has_noise and self.is_same:
            return used
        if self.sigma_needed is not None:
            used = Sigma.of(used.value, LEAST_NEEDED)
        of_diagnosis = self.diagnosis.calibration.sigma
        if self.diagnosis.records:
            of_diagnosis = of_diagnosis.model_copy(update={"kind": _least_sure(self.diagnosis)})
        if of_diagnosis.kind == "bound":
            return used
        taken = {"kind": of_diagnosis.kind, "basis": of_diagnosis.basis, "find": of_diagnosis.find}
        return used.model_copy(update=taken)

    def calibration(self) -> Calibration:
        """Return the calibration, in the way of the kind of record."""
        record, place = self.record, self.place
        if isinstance(record, StrapdownRecord):
            return self._by_reader(record, None)
        self._refuse_nothing()
        if place is not None and not self.wrong_rows and not self.changes and self.causes:
            return self._by_reader(record, place)
        remaining = record.selected(~np.isin(record.numbers, self.wrong_rows))
        request = self.request()
        if not self.at_rest and not self.changes:
            return self._without_effects(calibrate_whole(remaining, place, **vars(request)))
        evidence = bench_evidence(remaining, **vars(request))
        if evidence.reader.missing():
            raise InputError(f"{record.path}: does not determine the parameters even without effects; add positions")
        causes = {_place_in(evidence, cause, record): cause for cause in self.at_rest}
        named = Named(causes, not self.is_same, self.changes)
        sigma = self.sigma(evidence.model.calibration.sigma)
        return solve_with(Programme(remaining, evidence, named, request), sigma)

    def _refuse_nothing(self) -> None:
        """Refuse a diagnosis that names nothing of this record."""
        if self.causes or self.wrong_rows or self.changes or self.names_sigma:
            return
        if not self.diagnosis.explanations or self.diagnosis.causes:
            raise InputError("--with: the diagnosis names nothing that acts in this record; diagnose this record")
        if self.is_same:
            raise InputError(f"--with: {of_the_record(self.diagnosis)}; mend the record, and calibrate without --with")
        raise InputError(
            f"--with: {of_the_record(self.diagnosis)}; {self.record.path} is another record than the one that was "
            "diagnosed: diagnose it"
        )

    def _without_effects(self, calibration: Calibration) -> Calibration:
        """Return a calibration without effects, no surer than its σ."""
        sigma = self.sigma(calibration.sigma)
        changed: dict[str, Any] = {"sigma": sigma}
        if sigma.kind == "unknown":
            verdict = "insufficient" if calibration.verdict == "insufficient" else "noise-unknown"
            changed |= {"verdict": verdict, "parameters": without_guarantee(calibration.parameters)}
        return calibration.model_copy(update=changed)

    def _by_reader(self, record: PositionRecord | StrapdownRecord, place: Place | None) -> Calibration:
        """Return the calibration of a record in motion: its parameters beside all effects, gyros and all."""
        evidence = evidence_of(record, **self._options_in_motion(record, place))
        if evidence.reader.missing():
            raise InputError(f"{record.path}: does not determine the parameters even without effects")
        read_off = [effect.place for effect in evidence.reader.read_off]
        causes = [cause for cause in self.causes if cause.place not in read_off]
        places = [_place_in(evidence, cause, record) for cause in causes]
        fits = evidence.including(places).model.mended(places, Work())
        if not fits:
            title = " and ".join(place.title for place in places) or "what the diagnosis names"
            raise InputError(f"{record.path}: does not stand with {title}; diagnose this record")
        ways = [centred(evidence, fit) for fit in fits]
        calibration = evidence.reader.calibration_of(ways[0])
        effects = effects_of_fit(evidence, ways[0])
        parameters: list[Any] = calibration.parameters
        for way in ways[1:]:
            parameters = either_parameters(parameters, evidence.reader.calibration_of(way).parameters)
            effects = either_effects(effects, effects_of_fit(evidence, way))
        update = {"parameters": parameters, "effects": list(effects)}
        return self._without_effects(calibration.model_copy(update=update))

    def _options_in_motion(self, record: PositionRecord | StrapdownRecord, place: Place | None) -> dict[str, Any]:
        """Return the options of evidence in motion; an InputError for one that only rests have."""
        options = dict(self.options)
        of_rests = {"--target": options.pop("targets", ()), "--prior": options.pop("priors", ())}
        if options.pop("convention", "A1") != "A1":
            of_rests["--convention"] = ("A2",)
        for name, values in of_rests.items():
            if len(values):
                raise InputError(
                    f"{name} {values[0]}: is of readings at rest; leave it out, or calibrate without --with"
                )
        if isinstance(record, StrapdownRecord):
            options["baseline"] = self.diagnosis.baseline_model
        else:
            options |= {"noise_bound": self.request().noise_bound, "noise_sd": self.request().noise_sd, "bench": place}
        return evidence_options(record, **options)

    def warnings(self) -> list[str]:
        """Return sentences on the rows that the calibration leaves out and on the effects that it takes from the
        diagnosis."""
        warnings = []
        if self.wrong_rows:
            numbers = ", ".join(str(row) for row in self.wrong_rows)
            reason = one_line(self.explanation.sentence) if self.explanation is not None else ""
            noun = "row" if len(self.wrong_rows) == 1 else "rows"
            warnings.append(f"without {noun} {numbers}, as the diagnosis names: {reason}")
        if self.sigma_needed is not None:
            warnings.append(f"with σ = {exactly(self.sigma_needed)} g, {LEAST_NEEDED}; no bound that a person gave")
        if self.place is None and not isinstance(self.record, StrapdownRecord):
            for cause in self.causes:
                if cause not in self.at_rest:
                    warnings.append(
                        f"{cause.place.title}: acts on no reading at rest, and is left out; --latitude-deg and "
                        "--azimuth-deg calibrate the gyros with it"
                    )
        return warnings


def _least_sure(diagnosis: Diagnosis) -> str:
    """Return the kind of σ of several records on which least can be built."""
    kinds = [record.diagnosis.calibration.sigma.kind for record in diagnosis.records or ()]
    return next((kind for kind in ("unknown", "estimated") if kind in kinds), "bound")


def _place_in(evidence: Evidence, cause: Cause, record: PositionRecord | StrapdownRecord) -> EffectPlace:
    """Return the effect of a cause as evidence numbers it; an InputError where the record cannot have it."""
    if cause.effect == "outlier" and isinstance(record, PositionRecord):
        rows = np.flatnonzero(evidence.model.numbers == int(cause.where.removeprefix("position-")))
        if len(rows):
            return place_of(int(rows[0]) + 1, cause.place.axes[0])
    if cause.effect in WRITTEN:
        try:
            evidence.including([cause.place]).rows.columns_of([cause.place])
        except ValueError as error:
            raise InputError(f"{record.path}: --with {error}") from error
        return cause.place
    if cause.place not in (*evidence.rows.places, *getattr(evidence.model, "starting", ())):
        raise InputError(f"--with: {cause.place.title} is not an effect of {record.path}: another kind of record")
    return cause.place
