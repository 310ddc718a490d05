"""Apply a diagnosis: correct another record, or export FMUs that include the effects found."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.effects import EffectPlace
from ..calibration import Applied, AppliedEffect
from ..errors import InputError, one_line
from ..evidence.evidence import Evidence
from ..evidence.extension import Extension
from ..files import LARGEST_RESULT, bytes_of, whole_folder
from ..noise import block_parameters
from ..records import PositionRecord, StrapdownRecord
from ..records.columns import CORRECTED_BY, CORRECTED_WITHIN
from ..result import object_of, parsed_result
from ..rounding import upwards
from .cause import Cause, Finding
from .helps import figures_of
from .result import DIAGNOSES, Diagnosis, in_present_schema


def read_diagnosis(path: Path) -> Diagnosis | None:
    """The diagnosis that a file holds, of one record or several; None where it is something else.

    An InputError where it is not as its schema says.
    """
    content_bytes = bytes_of(path, most=LARGEST_RESULT)
    try:
        content = object_of(content_bytes, str(path))
    except InputError:
        return None
    return parsed_result(in_present_schema(content), DIAGNOSES, str(path))


def coefficients_of(cause: Cause) -> Floats:
    """Return the linear coefficients (K,) of a cause; an amplitude with phase gives a cosine and a sine."""
    values, coefficients = list(cause.values), []
    for number, (parameter, value) in enumerate(zip(cause.parameters, values, strict=True)):
        if parameter.name.endswith("amplitude"):
            phase = values[number + 1]
            coefficients += [value * np.cos(phase), value * np.sin(phase)]
        elif not parameter.name.endswith("phase"):
            coefficients.append(value)
    return np.array(coefficients)


def errors_of(cause: Cause) -> Floats:
    """Return the largest possible errors of the coefficients (K,) of a cause."""
    half = [max(high - value, value - low) for value, (low, high) in zip(cause.values, cause.intervals, strict=True)]
    errors = []
    for number, parameter in enumerate(cause.parameters):
        if parameter.name.endswith("amplitude"):
            # the chord of the phase at the largest amplitude, beside the amplitude's own error
            turn = min(half[number + 1], np.pi)
            error = half[number] + (abs(cause.values[number]) + half[number]) * 2.0 * np.sin(0.5 * turn)
            errors += [error, error]
        elif not parameter.name.endswith("phase"):
            errors.append(half[number])
    return np.array(errors)


def applied_to(diagnosis: Diagnosis, record: PositionRecord | StrapdownRecord, evidence: Evidence) -> Applied:
    """Apply the effects that a diagnosis names to another record, given that record's evidence.

    For several records, apply the effects of the instrument, and a record's own effects if it is one of them. An
    InputError for a diagnosis that names nothing, and for a record that cannot be run or was corrected before.
    """
    if CORRECTED_WITHIN in record.about:
        raise InputError(
            f"{record.path}: is corrected already ({record.about.get(CORRECTED_BY)}); apply the diagnosis to the "
            "record as it was measured"
        )
    if diagnosis.verdict != "explained":
        raise InputError(f"the diagnosis is {diagnosis.verdict}: it names nothing that could be applied")
    causes = diagnosis.causes_in(record.sha256)
    if not diagnosis.causes:
        raise InputError(f"{of_the_record(diagnosis)}; there is nothing to correct in a record")
    if not causes:
        raise InputError("the diagnosis names nothing that is the instrument's: what is a run's is of no other record")
    if missing := evidence.reader.missing():
        raise InputError(f"{record.path}: cannot be run: {'; '.join(map(str, missing.get('missing', ())))}")
    places = {c.place: c for c in causes if c.place in evidence.rows.linear_places}
    sizes = {place: coefficients_of(cause) for place, cause in places.items()}
    rerun = evidence.reader.rerun
    if rerun is None:
        raise InputError(f"{record.path}: no component simulates such a record")
    corrected, readings = rerun.without(sizes)
    effects = []
    for cause in causes:
        how = "left"
        if cause.place in corrected:
            how = "corrected"
        elif cause.place in sizes:
            how = "simulated"
        effects.append(AppliedEffect.model_validate({"effect": cause.place.title, "how": how}))
    errors: dict[str, Any] = {"rows": len(record), "warnings": list(record.warnings)}
    before = after = None
    if sizes:
        before, after = rerun.errors({}), rerun.errors(sizes)
    if before is not None and after is not None:
        over, unit, scale = rerun.quoted
        errors |= {"over": over, "unit": unit}
        for name, error in (("without", before), ("with", after)):
            errors |= {f"{key}_{name}": value for key, value in figures_of(error, scale).items()}
    if corrected:
        within = rerun.reach(sizes, {place: errors_of(cause) for place, cause in places.items()})
        about = _corrected(diagnosis, corrected, within, record)
        errors["record"] = replace(record, **readings, about=about)
    return Applied(effects=tuple(effects), **errors)


def _corrected(
    diagnosis: Diagnosis,
    places: Sequence[EffectPlace],
    within: NDArray | None,
    record: PositionRecord | StrapdownRecord,
) -> dict[str, str]:
    """Return the comment lines of a corrected record: effects removed, diagnosis used, bound of the error."""
    titles = " and ".join(place.title for place in places)
    lines = {CORRECTED_BY: f"{titles}, by {origin_of(diagnosis)}"}
    if within is not None:
        if not np.isfinite(within).all():
            raise InputError(f"{record.path}: not corrected: the diagnosis bounds no size of {titles}")
        lines[CORRECTED_WITHIN] = " ".join(upwards(size, 4) for size in within.tolist())
    return lines | dict(record.about)


def origin_of(diagnosis: Diagnosis) -> str:
    """Return which diagnosis it is, by the record that it was made from."""
    source = diagnosis.calibration.provenance
    if source is None and diagnosis.record is not None:
        return f"the diagnosis of the record with SHA-256 {diagnosis.record.sha256 or 'none'}"
    if source is None:
        return "a diagnosis of several records"
    return f"the diagnosis of {source.record} (SHA-256 {source.sha256 or 'none'})"


def of_the_record(diagnosis: Diagnosis) -> str:
    """Return the reason why a diagnosis that names a fault of its record gives no effect to any other."""
    fault = diagnosis.explanations[0].sentence.rstrip(".")
    return f"the diagnosis names no effect of the instrument but a fault of its record ({one_line(fault)})"


def nothing_exported(diagnosis: Diagnosis) -> str:
    """Return the reason why `export_extended` writes no file."""
    if diagnosis.verdict == "explained" and not diagnosis.causes:
        return of_the_record(diagnosis)
    if diagnosis.verdict == "explained":
        return f"no component simulates {' and '.join(cause.place.title for cause in diagnosis.causes)}"
    return f"the diagnosis is {diagnosis.verdict}: it names nothing that a component could simulate"


def export_extended(diagnosis: Diagnosis, folder: Path, flavour: str = "python") -> list[Path]:
    """Export the effects, the extension and the noise of a diagnosis into a folder; return the files, if any.

    FMUs of a flavour, "python" or "native", that start with the stated parameters and sizes; beside each a parameter
    set (.ssv) with these and their intervals; and scenarios that run them as the record was measured. An outlier is of
    no FMU. Of hypotheses it is the first that stands. Blocks start with the noise that the simulation lacks.

    An InputError where a value is outside the range of a component, or the folder cannot be written.
    """
    noise = {} if diagnosis.noise is None else block_parameters(diagnosis.noise.against)
    try:
        extension, titles = _extension_of(diagnosis)
        if noise:
            extension = (extension or Extension([], {})).with_noise(noise)
            titles.append("noise")
        if extension is None:
            return []
        with whole_folder(folder) as temporary:
            written = extension.write(temporary, f"found of a record: {' and '.join(titles)}", flavour)
        return [folder / path.name for path in written]
    except ValueError as error:
        raise InputError(f"--export {folder}: {error}") from error


def _extension_of(diagnosis: Diagnosis) -> tuple[Extension | None, list[str]]:
    """Return the components with the effects of a diagnosis, None without any, and the titles of the effects."""
    finding = _standing(diagnosis)
    if finding is None:
        return None, []
    effects = {cause.place: (cause.values, cause.intervals) for cause in finding.causes}
    rerun = diagnosis.evidence.including(finding.fit.places).reader.rerun
    if rerun is None:
        return None, []
    return rerun.extension(finding.fit, effects), [place.title for place in effects]


def _standing(diagnosis: Diagnosis) -> Finding | None:
    """Return the model to export: a fitting hypothesis, the extension of the model, or the explanation."""
    for hypothesis in diagnosis.hypotheses or ():
        if hypothesis.answer == "stands":
            return hypothesis.finding
    if diagnosis.extension is not None:
        return Finding(diagnosis.extension.causes, diagnosis.extension.fit)
    if diagnosis.verdict == "explained" and diagnosis.findings:
        return diagnosis.findings[0]
    return None
