"""What a diagnosis shows of its record: of rests on a table, whole benches among them, and of blocks that are carried.

Whatever the record, a page asks the same of it; `kind_of` alone looks up which of both it is.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ..diagnosis.result import Diagnosis
from ..document.blocks import Section
from ..document.notation import sentence
from ..motion.norm import norm_values
from ..records import PositionRecord
from ..rounding import digits, exactly, residual, upwards
from . import bench, calibration, evidence, witnesses
from .inspection import record_sections
from .sources import cited, versions


@dataclass(frozen=True)
class About:
    """What stands about a record on a page: its name, the figures below the verdict, what all rests on."""

    name: str
    key: Mapping[str, object]
    provenance: Mapping[str, object]


@dataclass(frozen=True)
class Kind:
    """What a page has of one kind of record.

    `record_sections`: what was measured and the model; `errors`: residuals, the first over the record; `values`: what
    is fitted, and what proves it false; `remarks`: sentences to bear in mind; `sources`: where methods are published.
    """

    about: Callable[[Diagnosis], About]
    record_sections: Callable[[Diagnosis, PositionRecord | None], list[Section]]
    errors: Callable[[Diagnosis], list[Section]]
    values: Callable[[Diagnosis], list[Section | None]]
    remarks: Callable[[Diagnosis], list[str]]
    sources: Callable[[Diagnosis], list[str]]


def kind_of(result: Diagnosis) -> Kind:
    """Return what shows the record of a diagnosis; errors of attitudes are those of a block that is carried."""
    return CARRIED if result.unit == "arcmin" else AT_TABLE


# Rests on a table, and whole benches


def _about_table(result: Diagnosis) -> About:
    nominal = result.evidence.calibration
    key = dict(bench.key_figures(nominal))
    if result.findings:
        key[f"with {evidence.first_words(result)}"] = f"{residual(result.findings[0].fit.radius)} σ"
    seed = {}
    if result.witness is not None and result.witness.shuffles:
        seed["seed of the shuffles"] = nominal.positions
    record = nominal.provenance.record if nominal.provenance is not None else "a record"
    return About(record, key, bench.provenance(nominal, seed))


def _table_sections(result: Diagnosis, record: PositionRecord | None) -> list[Section]:
    return [] if record is None else [bench.measured_section(record, result.calibration)]


def _table_values(result: Diagnosis) -> list[Section | None]:
    nominal = result.evidence.calibration
    values = evidence.target_section(result) or calibration.target_section(nominal)
    return [values, bench.proof_section(nominal, result.evidence.numbers)]


def _table_remarks(result: Diagnosis) -> list[str]:
    gain = result.gain
    remarks = witnesses.two_witnesses(result)
    if gain is None and result.verdict == "explained":
        remarks.append("Gain on held-out positions: not possible with these effects and positions.")
    if gain is not None and gain.over is None and not gain.improves:
        remarks.append("The extension does not improve the positions that were held out.")
    return remarks


def _table_sources(result: Diagnosis) -> list[str]:
    return bench.calibration_sources(result.evidence.calibration)


AT_TABLE = Kind(
    _about_table, _table_sections, evidence.residual_sections, _table_values, _table_remarks, _table_sources
)


# Blocks that are carried


def _about_carried(result: Diagnosis) -> About:
    record = result.evidence.found.record
    key: dict[str, object] = {"rows": len(record), "reference": result.reference}
    if result.radius is not None and result.noise_bound_arcmin is not None:
        key[f"bound, {evidence.quoted_words(result)}"] = f"{upwards(result.noise_bound_arcmin, 3)} arcmin"
        key["largest error"] = f"{residual(result.radius)} of its bound"
        if result.best is not None:
            key[f"with {evidence.first_words(result)}"] = residual(result.best.radius)
    provenance: dict[str, object] = {
        "record": record.path.name,
        "record, SHA-256": record.sha256,
        "reference": result.reference,
        "gravity": f"{exactly(result.evidence.found.gravity)} m/s²",
        "model": f"{result.baseline_model} block",
    }
    if record.rate is not None:
        provenance["a rate in the record is"] = result.evidence.rates
    if result.calibration.sigma.basis:
        provenance["bounds from"] = result.calibration.sigma.basis
    if witnesses.witnesses_of(result):
        provenance["seed of the shuffles"] = sum(part.error.size for part in result.evidence.parts)
    return About(record.path.name, key, provenance | versions())


def _carried_sections(result: Diagnosis, _: PositionRecord | None) -> list[Section]:
    """Return the record as it was inspected."""
    # Where gravity is the reference the accelerometers stand among the block's own parameters, better known.
    names = [p.symbol for p in result.stated.parameters]
    forces = not any(name.startswith("accelerometer") for name in names)
    return record_sections(result.evidence.found, result.warnings, forces=forces, gaps_named=bool(result.missing))


def bias_texts(result: Diagnosis) -> list[str]:
    """Return in a sentence the gyros' mean at rest that was taken out."""
    if result.bias_at_rest is None:
        return []
    shown = ", ".join([digits(math.degrees(rate), 4) for rate in result.bias_at_rest.radps])
    text = f"Gyro bias at rest, taken out: {shown} deg/s"
    if result.bias_at_rest.rms_if_left_in_arcmin is not None:
        text += f"; left in it would make the errors {digits(result.bias_at_rest.rms_if_left_in_arcmin)} arcmin rms"
    return [f"{text}."]


def _carried_errors(result: Diagnosis) -> list[Section]:
    return evidence.error_sections(result, bias_texts(result)) if result.evidence.parts else []


def _carried_remarks(result: Diagnosis) -> list[str]:
    """Return what is to be added, and why nothing is named in a record that the simulation explains."""
    remarks = [sentence(f"to add: {text}") for text in result.missing or ()]
    if result.verdict != "consistent":
        return remarks
    remarks.append(
        "No effect is named: with the block's own parameters every error stays within the noise, so nothing more is "
        "supported."
    )
    if result.excluded:
        effects = {(entry["effect"], entry["where"]) for entry in result.excluded}
        remarks.append(f"The record bounds {len(effects)} effects.")
    if result.cannot_be_seen:
        names = dict.fromkeys(place.effect for place in result.cannot_be_seen)
        remarks.append(f"This record cannot show: {', '.join(names)}.")
    return remarks


def _carried_sources(result: Diagnosis) -> list[str]:
    inspection = result.evidence.found
    norm = norm_values(inspection.accelerometers) is not None
    first = cited(norm and "norm", inspection.gyros is not None and "allan")
    if not result.evidence.parts:
        return first
    return first + cited("gyros", "attitude", "simplex", result.tried and "chebyshev", "fmi")


CARRIED = Kind(
    _about_carried,
    _carried_sections,
    _carried_errors,
    lambda result: [evidence.parameter_section(result)],
    _carried_remarks,
    _carried_sources,
)
