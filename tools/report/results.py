"""Results as sections of a page, and the pages of single commands."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from trihedron import __version__
from trihedron.attitude import AttitudeRun
from trihedron.calibration import Calibration
from trihedron.diagnosis import Diagnosis
from trihedron.diagnosis.extended_fit import ExtendedFit
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.records.reading import TableRun
from trihedron.report.calibration_pictures import residuals, target_intervals
from trihedron.report.calibration_sections import joint_set_sections, levelling_sections, rest_sections
from trihedron.report.diagnosis_pictures import candidates, held_out
from trihedron.report.direction_pictures import next_directions, residuals_over_inputs
from trihedron.report.judgement_sections import judgement_sections, structure_sections, target_sections
from trihedron.report.page import Section, Table, Tone, render_page
from trihedron.report.time_pictures import attitude_error, bench_tour
from trihedron.summaries import VERDICTS, missing_lines, position_text

TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}


def run_section(table: pl.DataFrame, gravity: float, files: list[Path]) -> Section:
    """The position programme that a run carried out."""
    readings = np.stack([table[f"f{p}_mps2"].to_numpy() for p in (1, 2, 3)], axis=1) / gravity
    hours = float(table["time_s"][-1])
    return Section(
        "The bench, simulated",
        [
            f"Three FMUs, coupled by the orchestrator: the table carries the block through its positions for "
            f"{hours:.0f} s, the block reads, the attitude computer follows the increments."
        ],
        bench_tour(table["time_s"], table["alpha_deg"], table["beta_deg"], readings),
        "Angles of the two axes and readings of the three accelerometers.",
        files=files,
    )


def calibration_section(
    result: Calibration, truth: Mapping[str, float] | None = None, files: list[Path] | None = None
) -> Section:
    """Targets with their intervals."""
    header = ["target", "meaning", "estimate", "guaranteed error", "low", "high", "unit"]
    rows = [[e.symbol, e.name, e.estimate, e.guaranteed_error, e.low, e.high, e.unit] for e in result.parameters]
    if truth is not None:
        header.append("truth")
        rows = [[*row, truth.get(str(row[0]))] for row in rows]
    return Section(
        "Calibration with guaranteed bounds",
        [
            VERDICTS[result.verdict].capitalize() + ".",
            f"{result.positions} positions, {result.measurements} readings, σ = {result.noise_bound:.3g} g "
            f"({result.noise_bound_basis}); least possible largest residual {result.radius:.3f} σ.",
            *missing_lines(result),
        ],
        target_intervals(result.parameters, result.noise_bound, truth),
        "Each target's exact interval and a-priori guaranteed error, in units of σ.",
        Table(header, rows),
        files or [],
    )


def diagnosis_sections(result: Diagnosis, files: list[Path] | None = None) -> list[Section]:
    """Evidence, candidates, cause and gain."""
    nominal = result.baseline
    here = nominal.linearised
    sigma = nominal.noise_bound
    fit = result.findings[0].fit if result.findings else None
    proof = np.zeros((len(here.reading), 3), dtype=bool)
    witness = set(nominal.witness)
    numbers = result.position_numbers
    for i, axis in np.ndindex(*proof.shape):
        proof[i, axis] = (int(numbers[i]), axis + 1) in witness
    sections = [
        Section(
            "Can the simulation's model be true?",
            [
                f"Whatever its parameters, the nominal model leaves a largest residual of at least "
                f"{nominal.radius:.2f} σ (σ = {sigma:.3g} g)."
                + (f" {len(nominal.witness)} readings alone prove it." if nominal.witness else "")
            ],
            residuals(
                np.degrees(here.positions.alpha),
                np.degrees(here.positions.beta),
                centred(here.residual, here.bound, None),
                centred(fit.residual, fit.bound, fit) if fit is not None else None,
                proof,
            ),
            "Residuals over the angles of the outer and the inner axis; the band is the noise bound.",
        ),
        Section(
            "Against the inputs",
            [],
            residuals_over_inputs(
                here.input,
                centred(here.residual, here.bound, None),
                centred(fit.residual, fit.bound, fit) if fit is not None else None,
                proof,
            ),
            "Residuals of each accelerometer against its own input.",
        ),
    ]
    if result.tried:
        shown = result.tried[:16]
        sections.append(
            Section(
                "Which effect mends it?",
                [
                    "Each effect of the catalogue was added to the model in turn. At or below one σ the extended model "
                    "explains every reading."
                ],
                candidates([title for title, _ in shown], [radius for _, radius in shown]),
                "Least largest residual that each effect leaves, in units of σ; the best sixteen.",
            )
        )
    if result.causes:
        sections.append(cause_section(result, files or []))
    if result.gain is not None:
        gain = result.gain
        summary = gain.summary()
        before = np.where(gain.scored, gain.before, np.nan) / sigma
        after = np.where(gain.scored, gain.after, np.nan) / sigma
        sections.append(
            Section(
                "The gain on positions that were not used",
                [
                    f"{len(gain.positions)} positions were left out of the fit and simulated by the FMUs, without the "
                    f"effect and with it. Root mean square {summary['held_out_rms_before']:.2e} g before, "
                    f"{summary['held_out_rms_after']:.2e} g after; maximum {summary['held_out_max_before']:.2e} g "
                    f"before, {summary['held_out_max_after']:.2e} g after."
                ],
                held_out(before, after, [int(numbers[i]) for i in gain.positions]),
                "Measurement less simulation at the positions that were held out.",
            )
        )
    sections += [*judgement_sections(result), *target_sections(result), *structure_sections(result)]
    if result.next_positions:
        sections.append(next_section(result))
    if result.excluded:
        sections.append(excluded_section(result))
    return sections


def next_section(result: Diagnosis) -> Section:
    """Where to measure next, on the sphere of directions."""
    at = result.baseline.linearised.positions
    proposed = result.next_positions
    alpha, beta = (np.radians([float(p[name]) for p in proposed]) for name in ("alpha_deg", "beta_deg"))
    return Section(
        "Where to measure next",
        [f"{k}: {position_text(position)}." for k, position in enumerate(proposed, start=1)],
        next_directions(at.alpha, at.beta, alpha, beta, [str(k) for k in range(1, len(proposed) + 1)]),
        "The vertical as the inner frame sees it at each position; equal areas are equal solid angles.",
    )


def excluded_section(result: Diagnosis) -> Section:
    """Upper bounds of the effects that were not found."""
    rows = [
        [
            EffectPlace(e["effect"], e["where"], e.get("order"), tuple(e.get("axes", ()))).title,
            e["parameter"],
            e["above"],
            e["unit"],
        ]
        for e in result.excluded
    ]
    table = Table(["effect", "parameter", "excluded above", "unit"], rows)
    return Section("What the record excludes", ["Larger sizes of these effects contradict the record."], table=table)


def centred(residual: np.ndarray, bound: np.ndarray, fit: ExtendedFit | None) -> np.ndarray:
    """Residuals (N, 3) over their bounds; of an extended fit, at its Chebyshev centre."""
    left = residual if fit is None else residual - fit.jacobian @ fit.centre
    return (left / bound).reshape(-1, 3)


def cause_section(result: Diagnosis, files: list[Path]) -> Section:
    """The cause that was named, or the candidates that remain."""
    rows = [
        [cause.place.title, parameter.name, value, finite(low), finite(high), parameter.unit, finding.fit.radius]
        for finding in result.findings
        for cause in finding.causes
        for parameter, value, (low, high) in zip(
            CATALOGUE[cause.place.effect].at(cause.place).parameters, cause.values, cause.intervals, strict=True
        )
    ]
    same = [e.title for cause in result.causes for e in cause.equivalents]
    same += [" with ".join(place.title for place in places) for places in result.equivalent_sets]
    told = [cause.sentence.capitalize() + "." for finding in result.findings for cause in finding.causes]
    if same:
        told.append(f"No measurement on this bench could tell it from: {', '.join(same)}.")
    if result.mounting is not None:
        told.append(
            f"A second mounting, {result.mounting.mounting}, tells apart {' and '.join(result.mounting.separates)}: "
            f"their correlation falls from {result.mounting.correlation_before:.2f} to "
            f"{result.mounting.correlation_after:.2f}."
        )
    if not result.complete:
        told.append("The search was cut off: more sets of effects would make the model consistent.")
    return Section(
        "The cause" if result.verdict == "explained" else "Causes that remain",
        told,
        table=Table(["effect", "parameter", "estimate", "low", "high", "unit", "radius [σ]"], rows),
        files=files,
    )


def finite(value: float) -> float | None:
    """The value, or None where it is not bounded."""
    return value if math.isfinite(value) else None


def attitude_section(runs: Sequence[AttitudeRun]) -> Section:
    """Attitude errors of a measured record; the picture is that of the last run."""
    shown = runs[-1]
    return Section(
        "A measured strapdown record",
        [line for k, run in enumerate(runs) for line in run.summary()[min(k, 1) :]],
        attitude_error(shown.time_s, np.degrees(shown.error_rad), np.degrees(shown.error_angle)),
        "Attitude from the measured gyros, "
        + ("" if shown.gyro_bias is None else "their bias at rest taken out, ")
        + "less the true attitude.",
        files=[file for run in runs for file in run.files],
    )


def calibration_page(result: Calibration, run: TableRun) -> str:
    """The page of `trihedron calibrate`."""
    return render_page(
        f"Calibration of {run.record.path.name}",
        VERDICTS[result.verdict].capitalize() + ".",
        [
            calibration_section(result),
            *levelling_sections(result),
            *joint_set_sections(result),
            *rest_sections(run),
        ],
        tone=TONES.get(result.verdict, "attention"),
        provenance=provenance(result),
    )


def diagnosis_page(result: Diagnosis, name: str) -> str:
    """The page of `trihedron diagnose`."""
    return render_page(
        f"Diagnosis of {name}",
        verdict_sentence(result),
        diagnosis_sections(result),
        tone=TONES.get(result.verdict, "attention"),
        provenance=provenance(result.baseline),
    )


def verdict_sentence(result: Diagnosis) -> str:
    """The verdict, with the cause when one is named."""
    if result.verdict == "explained":
        return f"The simulation lacked this: {'; '.join(cause.sentence for cause in result.causes)}."
    return VERDICTS[result.verdict].capitalize() + "."


def provenance(result: Calibration) -> dict[str, object]:
    """What a result rests on."""
    return {
        "trihedron": __version__,
        "noise bound": f"{result.noise_bound:.6g} g ({result.noise_bound_basis})",
        "gravity": f"{result.gravity:.8g} m/s²",
        "baseline": result.baseline,
        "mountings": ", ".join(result.linearised.parametrisation.mountings),
    }
