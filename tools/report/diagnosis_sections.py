"""Sections of a diagnosis: evidence, cause, gain, what is excluded; and the page of `trihedron diagnose`."""

import math
from pathlib import Path

import numpy as np

from ...models.effects import CATALOGUE
from ..diagnosis import Diagnosis
from ..records import PositionRecord
from ..summaries import MOST_SETS, VERDICTS, open_targets
from .calibration_pictures import residuals
from .cells import Cell
from .diagnosis_pictures import held_out
from .direction_pictures import residuals_over_inputs
from .evidence_sections import (
    CONFUSION,
    centred,
    confusion_section,
    proved,
    ranking_section,
    witness_section,
)
from .excluded_sections import excluded_sections
from .judgement_sections import judgement_sections, structure_sections, target_sections
from .model_sections import cause_lines, extended_values, model_section
from .next_sections import deciding, next_sections
from .page import Section, Table, Tone, render_page
from .record_sections import key_figures, measured_section, provenance
from .rounding import Written, outwards, to_bound, unit_text
from .sources import diagnosis_sources
from .target_sections import target_section

FEW_RIVALS = 3
"""Up to so many sets of effects are named in the verdict."""
TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}


def diagnosis_page(result: Diagnosis, record: PositionRecord) -> str:
    """The page as HTML: verdict, record, model, residuals, targets, evidence, what is excluded, what next."""
    named = result.causes if result.verdict == "explained" else ()
    seeds = {}
    if result.judgement is not None and result.judgement.shuffles:
        seeds["seed of the shuffles"] = len(record)
    sections = [
        measured_section(record, result.evidence.calibration),
        model_section(result.evidence.calibration, extended_values(result), named),
        *diagnosis_sections(result, record),
    ]
    return render_page(
        f"Diagnosis of {record.path.name}",
        verdict_sentence(result),
        sections,
        tone=TONES.get(result.verdict, "attention"),
        key=key_figures(result.evidence.calibration)
        | ({f"with {first_words(result)}": f"{result.findings[0].fit.radius:.2f} σ"} if result.findings else {}),
        provenance=provenance(result.evidence.calibration, seeds),
        sources=diagnosis_sources(result, compared=any(s.title == CONFUSION for s in sections)),
    )


def first_words(result: Diagnosis) -> str:
    """What the figures with the effects are of: the effects that were named, or the first of the sets that remain."""
    if result.verdict != "explained":
        return "the first of the sets that remain"
    return "the effect" if len(result.causes) == 1 else "the effects"


def verdict_sentence(result: Diagnosis) -> str:
    """The verdict, with the cause when one is named."""
    nominal = result.evidence.calibration
    if result.verdict == "explained":
        return f"The simulation lacked this: {'; '.join(cause.sentence for cause in result.causes)}."
    if result.verdict == "ambiguous":
        return f"The simulation lacks something, and the record does not say what: {rivals(result)}"
    if result.verdict == "unexplained":
        return (
            f"The simulation lacks something that is not in the catalogue: no parameters leave less than "
            f"{nominal.radius:.3g} σ, and no set of up to three effects mends it."
        )
    if result.verdict == "insufficient":
        return (
            f"Too little was measured to judge the simulation: the readings do not determine {open_targets(nominal)}."
        )
    return VERDICTS[result.verdict].capitalize() + "."


def rivals(result: Diagnosis) -> str:
    """The sets of effects that remain, few by their names, and what further positions would do."""
    if result.complete is not False and len(result.findings) <= FEW_RIVALS:
        said = f"{' or '.join(finding.title for finding in result.findings)} would explain it."
    else:
        more = " or more" if result.complete is False else ""
        said = f"{len(result.findings)}{more} sets of effects would explain it."
    proposed = len(result.next_positions or ())
    if not proposed:
        return said
    sure = len(deciding(result.evidence.calibration.linearised, result.next_positions or ()))
    if sure == proposed:
        return f"{said} Readings at {proposed} further position{'s' if proposed > 1 else ''} decide."
    return f"{said} Of {proposed} further positions that are proposed {tells(sure)} two of them apart."


def tells(count: int) -> str:
    """So many positions surely tell something."""
    return "none surely tells" if not count else "one surely tells" if count == 1 else f"{count} surely tell"


def named_words(result: Diagnosis) -> str:
    """The first of several sets by its name."""
    return "" if result.verdict == "explained" else f", {result.findings[0].title},"


def diagnosis_sections(result: Diagnosis, record: PositionRecord, files: list[Path] | None = None) -> list[Section]:
    """From the residuals to what is excluded and what to measure next."""
    sections = [*residual_sections(result)]
    if result.causes:
        sections.append(cause_section(result, files or []))
    sections += target_sections(result) or [target_section(result.evidence.calibration)]
    sections += [*witness_section(result.evidence.calibration, result.evidence.numbers), *ranking_section(result)]
    sections += confusion_section(result)
    if result.gain is not None:
        sections.append(gain_section(result))
    return [
        *sections,
        *judgement_sections(result),
        *structure_sections(result),
        *excluded_sections(result),
        *next_sections(result.evidence.calibration.linearised, result.next_positions or ()),
    ]


def residual_sections(result: Diagnosis) -> list[Section]:
    """Residuals without and with the effects, over the angles and over the inputs."""
    here = result.evidence.calibration.linearised
    fit = result.findings[0].fit if result.findings else None
    proof = proved(result.evidence.calibration, result.evidence.numbers)
    before = centred(here.residual, here.bound, None)
    after = centred(fit.residual, fit.bound, fit) if fit is not None else None
    least = f"{result.evidence.calibration.radius:.2f} σ"
    said = f"Whatever its parameters, the nominal model leaves a largest residual of at least {least}."
    if fit is not None:
        said += f" With {first_words(result)}{named_words(result)} it leaves {fit.radius:.2f} σ."
    return [
        Section(
            "Residuals before and after" if fit is not None else "Residuals",
            [said],
            residuals(np.degrees(here.positions.alpha), np.degrees(here.positions.beta), before, after, proof),
            "Residuals over the angles of the outer and the inner axis; the band is the noise bound.",
        ),
        Section(
            "Residuals against the inputs",
            [],
            residuals_over_inputs(here.input, before, after, proof),
            "Residuals of each accelerometer against its own input.",
        ),
    ]


def cause_section(result: Diagnosis, files: list[Path]) -> Section:
    """The cause that was named, or the candidates that remain."""
    named = result.verdict == "explained"
    rows: list[list[Cell]] = []
    for number, finding in enumerate(result.findings, start=1):
        for cause in finding.causes:
            effect = CATALOGUE[cause.place.effect].at(cause.place)
            for parameter, value, (low, high) in zip(effect.parameters, cause.values, cause.intervals, strict=True):
                half = 0.5 * (high - low) if math.isfinite(high - low) else None
                ends = outwards(low, high, half) if half else (Written(f"{low:.3g}"), Written(f"{high:.3g}"))
                left = Written(f"{finding.fit.radius:.2f}")
                row: list[Cell] = [cause.place.title, parameter.name, to_bound(value, half), *ends]
                rows.append([*([] if named else [number]), *row, unit_text(parameter.unit), left])
    same = [e.title for cause in result.causes for e in cause.alike]
    same += [" with ".join(place.title for place in places) for places in result.equal_sets]
    shown = result.findings[:MOST_SETS]
    told = [
        f"{'' if named else f'Set {number}: '}{'; '.join(cause.sentence for cause in finding.causes)}."
        for number, finding in enumerate(shown, start=1)
    ]
    told = [text[0].upper() + text[1:] for text in told]
    if len(result.findings) > len(shown):
        told.append(f"{len(result.findings) - len(shown)} sets more are in the table; the first leave least.")
    if same and named:
        told.append(f"No measurement on this bench could tell it from: {', '.join(same)}.")
    if result.second_mounting is not None:
        other = result.second_mounting
        told.append(
            f"A second mounting, {other.mounting}, tells apart {' and '.join(other.separates)}: "
            f"their correlation falls from {other.correlation_before:.2f} to {other.correlation_after:.2f}."
        )
    if result.complete is False:
        told.append("The search was cut off: more sets of effects would make the model consistent.")
    return Section(
        "The cause" if named else "Causes that remain",
        told,
        table=Table(
            [*([] if named else ["set"]), "effect", "parameter", "estimate", "low", "high", "unit", "leaves [σ]"], rows
        ),
        files=files,
        equations=cause_lines([cause for finding in shown for cause in finding.causes]) if not named else (),
    )


def gain_section(result: Diagnosis) -> Section:
    """What the extended simulation gains on positions that were not used."""
    assert result.gain is not None
    gain, sigma = result.gain, result.evidence.calibration.noise_bound
    summary = gain.to_json()
    before, after = gain.before / sigma, gain.after / sigma
    return Section(
        "The gain on positions that were not used",
        [
            f"{len(gain.rows)} positions were left out of the fit and simulated by the FMUs, without the effect "
            f"and with it. Root mean square {summary['held_out_rms_before']:.1e} g before, "
            f"{summary['held_out_rms_after']:.1e} g after; maximum {summary['held_out_max_before']:.1e} g before, "
            f"{summary['held_out_max_after']:.1e} g after."
        ],
        held_out(before, after, [int(result.evidence.numbers[i]) for i in gain.rows]),
        "Measurement less simulation at the positions that were held out.",
    )
