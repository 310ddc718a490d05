"""What a diagnosis says: text, evidence, cause, gain, what is excluded; the page."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from ...models.effects import CATALOGUE
from ..diagnosis import Cause, Diagnosis
from ..document.blocks import Page, Section, Table, Tone
from ..document.numbers import Cell, Written, outwards, to_bound, unit_of, unit_text
from ..records import PositionRecord
from .calibration import target_section
from .evidence import (
    CONFUSION,
    centred,
    confusion_section,
    deciding,
    judgement_sections,
    next_sections,
    proved,
    ranking_section,
    structure_sections,
    target_sections,
    witness_section,
)
from .excluded import excluded_sections
from .model import cause_lines, extended_values, model_section
from .pictures.residuals import held_out, residuals, residuals_over_inputs
from .record import diagnosis_sources, key_figures, measured_section, provenance
from .strapdown import diagnosis_lines, strapdown_page
from .words import VERDICTS, open_targets, position_text, witness_lines

FEW_RIVALS = 3
"""Up to so many sets of effects are named in the verdict."""
TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}


def diagnosis_page(result: Diagnosis, record: PositionRecord) -> Page:
    """The page as HTML: verdict, record, model, residuals, targets, evidence, what is excluded, what next."""
    named = result.causes if result.verdict == "explained" else ()
    seeds = {}
    if result.witness is not None and result.witness.shuffles:
        seeds["seed of the shuffles"] = len(record)
    sections = [
        measured_section(record, result.evidence.calibration),
        model_section(result.evidence.calibration, extended_values(result), named),
        *diagnosis_sections(result, record),
    ]
    return Page(
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


MOST_SETS = 6
"""So many sets that remain are printed."""


def judgement_lines(result: Diagnosis) -> list[str]:
    """What readings that were left out say, and a mounting that would help."""
    lines = []
    if result.witness is not None:
        for name, part in (("positions", result.witness.folds), ("parts in time", result.witness.blocks)):
            if part is not None:
                said = part.to_json()
                lines.append(
                    f"left-out {name} ({said['scored']} readings): rms {said['rms_before']:.2e} -> "
                    f"{said['rms_after']:.2e} g, max {said['max_before']:.2e} -> {said['max_after']:.2e} g"
                )
        if result.witness.shuffles:
            shuffles = result.witness.shuffles
            shuffles = result.witness.shuffles
            lines.append(f"as good when shuffled: {shuffles.as_good} of {shuffles.tried}")
        lines += [f"warning: {warning}" for warning in result.witness.warnings]
    if result.second_mounting is not None:
        other = result.second_mounting
        lines.append(
            f"a second mounting ({other.mounting}) tells apart {' and '.join(other.separates)}: "
            f"correlation {other.correlation_before:.2f} -> {other.correlation_after:.2f}"
        )
    return lines


def cause_text(cause: Cause) -> list[str]:
    """A cause with its parameters."""
    lines = [f"cause: {cause.place.title}: {cause.sentence}"]
    for parameter, value, (low, high) in zip(
        CATALOGUE[cause.place.effect].at(cause.place).parameters, cause.values, cause.intervals, strict=True
    ):
        text = f"  {parameter.name} {value:+.4e}, within [{low:+.4e}, {high:+.4e}] {unit_of(parameter.unit)}"
        lines.append(text.rstrip())
    return lines + [f"  cannot be told from {other.title}" for other in cause.alike]


def diagnosis_summary(result: Diagnosis) -> str:
    """Verdict, evidence, cause and gain."""
    nominal = result.evidence.calibration
    lines = [
        VERDICTS[result.verdict],
        f"{nominal.positions} positions, {nominal.measurements} readings, σ = {nominal.noise_bound:.3g} g "
        f"({nominal.noise_bound_basis}); nominal model: radius {nominal.radius:.3f}",
        *witness_lines(nominal),
    ]
    for finding in result.findings[:MOST_SETS]:
        for cause in finding.causes:
            lines += cause_text(cause)
        lines.append(f"  radius with {'it' if len(finding.causes) == 1 else 'them'} {finding.fit.radius:.3f}")
    if len(result.findings) > MOST_SETS:
        lines.append(f"  ... and {len(result.findings) - MOST_SETS} sets more")
    for places in result.equal_sets:
        lines.append(f"  cannot be told from {' and '.join(place.title for place in places)}")
    if result.gain is not None:
        g = result.gain.to_json()
        lines.append(
            f"held-out positions, simulated again ({int(np.isfinite(result.gain.before).sum())} readings): "
            f"rms {g['held_out_rms_before']:.2e} -> {g['held_out_rms_after']:.2e} g, "
            f"max {g['held_out_max_before']:.2e} -> {g['held_out_max_after']:.2e} g"
        )
    elif result.verdict == "explained":
        lines.append("gain on held-out positions: not possible with these effects and positions")
    if result.gain is not None and not result.gain.improves:
        lines.append("warning: the extension does not improve the positions that were held out")
    lines += judgement_lines(result)
    if result.complete is False:
        lines.append("warning: the search was cut off: more sets of effects would make the model consistent")
    for entry in (result.residual_structure or ())[:5]:
        lines.append(
            f"residual of accelerometer {entry.get('accelerometer')}: {100 * entry['explained']:.0f} % of it is "
            f"predicted by {entry['on']}; {100 * entry['explainable']:.0f} % is more than noise"
        )
    lines += [f"measure next: {position_text(position)}" for position in result.next_positions or ()]
    lines += [f"warning: {warning}" for warning in nominal.warnings]
    return "\n".join(lines)


def said(result: Diagnosis) -> list[str]:
    """What a terminal shows of a diagnosis, whatever the record."""
    return diagnosis_summary(result).split("\n") if result.unit is None else diagnosis_lines(result)


def page(result: Diagnosis, record: Any) -> Page:
    """The page of a diagnosis, whatever the record."""
    return diagnosis_page(result, record) if result.unit is None else strapdown_page(result)
