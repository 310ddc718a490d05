"""Witnesses of an effect: left-out parts of the record, and for a whole bench accelerometers and gyros."""

import numpy as np

from ..diagnosis.result import Diagnosis
from ..diagnosis.witness import EffectWitness, Witness
from ..document.blocks import Section, Table
from ..document.notation import Cell, sentence
from ..evidence.bench import TurnErrors
from ..rounding import digits, residual, to_bound, upwards
from .pictures.residuals import errors_of_turns

MOST_TURNS = 12
COARSE = 0.05
"""Times [s] and turns [deg] are shown to a tenth of this and finer by one digit."""


def witnesses_of(result: Diagnosis) -> tuple[EffectWitness, ...]:
    """Return the result of the left-out parts for each effect of the first set."""
    return result.judgement if isinstance(result.judgement, tuple) else ()


def judgement_section(result: Diagnosis) -> Section | None:
    """Return the result of left-out and shuffled parts for the effects, with the reasons against naming them; None
    without any."""
    judgement = result.judgement
    if not judgement and not result.not_named:
        return None
    paragraphs = [
        "Parts of the record were left out in turn and predicted from the rest, without the effects and with them; "
        "then their signatures were shuffled over the record. This is a second witness, no evidence: almost any effect "
        "improves some of it."
    ]
    table = None
    if isinstance(judgement, Witness):
        paragraphs += _joint_texts(judgement)
        table = _joint_table(judgement)
    elif judgement:
        rows = []
        for w in judgement:
            shuffles = f"{w.shuffles.as_good} of {w.shuffles.tried}"
            rows.append([w.title, digits(w.rms_without), digits(w.rms_with), shuffles])
        paragraphs.append("An effect that does not help, or whose shuffles do as well, is not named.")
        header = ["effect", "rms over the bound without it", "with it", "shuffles that do as well"]
        table = Table(header, rows)
    paragraphs += [f"Not named: {text}." for text in result.not_named or ()]
    paragraphs += [f"Against the first set: {text}." for text in result.objections or ()]
    return Section("Left-out readings and permutation test", paragraphs, table=table)


def _joint_texts(witness: Witness) -> list[str]:
    """Return sentences on the shuffles, and on each effect beside the others."""
    texts = []
    if witness.shuffles:
        texts.append(
            f"Permutation test: {witness.shuffles.as_good} of {witness.shuffles.tried} shuffles predicted the left-out "
            "readings as well."
        )
    if witness.not_judged is not None:
        texts.append(sentence(witness.not_judged))
    for w in witness.each:
        texts.append(
            f"Beside the others, {w.title} lowers the left-out errors from {digits(w.rms_without)} to "
            f"{digits(w.rms_with)} of their bound (rms); {w.shuffles.as_good} of {w.shuffles.tried} shuffles do as "
            "well."
        )
    return texts


def _joint_table(witness: Witness) -> Table | None:
    """Return the errors of left-out parts, without and with the effects; None if no part could be left out."""
    rows = []
    for name, score in (("every fifth position", witness.folds), ("every quarter of the time", witness.blocks)):
        if score is not None:
            row: list[Cell] = [name, score.scored]
            row += [digits(score.rms_before, 2), digits(score.rms_after, 2)]
            row += [upwards(score.max_before), upwards(score.max_after)]
            rows.append(row)
    header = ["left out", "readings", "rms before [g]", "rms after [g]", "max before [g]", "max after [g]"]
    return Table(header, rows)


def _turns(result: Diagnosis) -> TurnErrors | None:
    """Return errors of the turns between positions, without and with the first set of effects, if gyros sensed them."""
    return result.sources.turns_of(result.findings[0].fit if result.findings else None)


def two_witnesses(result: Diagnosis) -> list[str]:
    """Return a sentence on the gyros during turns, and on the accelerometers at rests, each by itself."""
    turns = _turns(result)
    if turns is None:
        return []
    radii = []
    for alone in turns.alone:
        texts = [residual(radius) for radius in alone]
        radii.append(" -> ".join(texts if result.findings else texts[:1]))
    rests, moments = result.calibration.positions or 0, turns.readings
    return [
        f"Two witnesses, each by itself: accelerometers, over {rests} rests and {moments - rests} moments in motion, "
        f"radius {radii[0]}; gyros, over {len(turns.first)} rests and turns, radius {radii[1]}."
    ]


def turn_sections(result: Diagnosis) -> list[Section]:
    """Return the residuals of the turns between positions, if gyros sensed them."""
    turns = _turns(result)
    if turns is None:
        return []
    before, after = np.abs(turns.before).max(axis=1), np.abs(turns.after).max(axis=1)
    text = (
        "The gyros' integrals, less the turns by the encoders, by a fit in which readings and turns that misfit have "
        f"little weight. {two_witnesses(result)[0]}"
    )
    rows = []
    for k in np.argsort(-before, kind="stable")[:MOST_TURNS].tolist():
        outer, inner = np.degrees(turns.turned[k])
        row: list[Cell] = [to_bound(float(turns.first[k]), COARSE), to_bound(float(turns.last[k]), COARSE)]
        row += [to_bound(float(outer), COARSE), to_bound(float(inner), COARSE)]
        row += [residual(float(before[k])), residual(float(after[k])) if result.findings else None]
        rows.append(row)
    header = ["from [s]", "to [s]", "outer turn [deg]", "inner turn [deg]", "error over its bound", "with the effects"]
    middle = 0.5 * (turns.first + turns.last)
    picture = errors_of_turns(middle, before, after if result.findings else None)
    caption = "Largest error of each rest, move and part of a move over its bound. The table has the worst."
    return [Section("Turns, as the gyros saw them", [text], picture, caption, Table(header, rows))]
