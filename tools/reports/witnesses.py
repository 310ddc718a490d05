"""Who speaks for an effect: what was left out of the fit, and of a whole bench accelerometers and gyros."""

import numpy as np

from ..diagnosis.result import Diagnosis
from ..diagnosis.witness import EffectWitness, Witness
from ..document.blocks import Section, Table
from ..document.notation import Cell, sentence
from ..evidence.bench import TurnErrors
from ..rounding import digits, residual, upwards

MOST_TURNS = 12


def witnesses_of(result: Diagnosis) -> tuple[EffectWitness, ...]:
    """What was left out says of each effect of the first set."""
    return result.judgement if isinstance(result.judgement, tuple) else ()


def judgement_section(result: Diagnosis) -> Section | None:
    """What was left out and shuffled says of the effects, and why they are not named."""
    judgement = result.judgement
    if not judgement and not result.not_named:
        return None
    paragraphs = [
        "Parts of the record were left out in turn and predicted from the rest, without the effects and with them; "
        "then their signatures were shuffled over the record. This is a second witness, no evidence: almost any effect "
        "improves some of it."
    ]
    rows: list[list[Cell]] = []
    if isinstance(judgement, Witness):
        header = ["left out", "readings", "rms before [g]", "rms after [g]", "max before [g]", "max after [g]"]
        for name, score in (("every fifth position", judgement.folds), ("every quarter of the time", judgement.blocks)):
            if score is not None:
                rms = (digits(figure, 2) for figure in (score.rms_before, score.rms_after))
                largest = map(upwards, (score.max_before, score.max_after))
                rows.append([name, score.scored, *rms, *largest])
        if judgement.shuffles:
            paragraphs.append(
                f"Shuffled, the effects predicted what was left out as well in {judgement.shuffles.as_good} of "
                f"{judgement.shuffles.tried} trials."
            )
        paragraphs += [] if judgement.not_judged is None else [sentence(judgement.not_judged)]
        paragraphs += [
            f"Beside the others, {w.title} brings what was left out from {digits(w.rms_without)} to "
            f"{digits(w.rms_with)} of its bound (rms), and {w.shuffles.as_good} of {w.shuffles.tried} of its shuffles "
            "do as well."
            for w in judgement.each
        ]
    else:
        header = ["effect", "rms over the bound without it", "with it", "shuffles that do as well"]
        for w in judgement or ():
            errors = (digits(value) for value in (w.rms_without, w.rms_with))
            rows.append([w.title, *errors, f"{w.shuffles.as_good} of {w.shuffles.tried}"])
        paragraphs.append("An effect that does not help, or whose shuffles do as well, is not named.")
    paragraphs += [f"Not named: {text}." for text in result.not_named or ()]
    paragraphs += [f"Against the first set: {text}." for text in result.objections or ()]
    return Section("Left out, and shuffled", paragraphs, table=Table(header, rows) if rows else None)


def _turns(result: Diagnosis) -> TurnErrors | None:
    """Errors of the turns between positions, without and with the first set of effects, where gyros have seen them."""
    return result.evidence.turns_of(result.findings[0].fit if result.findings else None)


def two_witnesses(result: Diagnosis) -> list[str]:
    """Return what gyros say of the turns, and accelerometers of the rests, each by itself, in a sentence."""
    turns = _turns(result)
    if turns is None:
        return []
    radii = []
    for alone in turns.alone:
        shown = [residual(radius) for radius in alone]
        radii.append(" -> ".join(shown if result.findings else shown[:1]))
    rests = result.evidence.calibration.positions
    return [
        f"Two witnesses, each by itself: accelerometers, over {rests} rests, radius {radii[0]}; gyros, over "
        f"{len(turns.first)} rests and turns, radius {radii[1]}."
    ]


def turn_sections(result: Diagnosis) -> list[Section]:
    """What is left of the turns between positions, without and with the effects, where gyros have seen them."""
    if (turns := _turns(result)) is None:
        return []
    sizes = [np.abs(errors).max(axis=1) for errors in (turns.before, turns.after)]
    text = (
        "The gyros' integrals over rests, moves and parts of moves are held against the turns by the encoders. "
        f"{two_witnesses(result)[0]} The largest errors:"
    )
    rows: list[list[Cell]] = []
    for k in np.argsort(-sizes[0], kind="stable")[:MOST_TURNS]:
        degrees = (digits(float(np.degrees(angle)), 5) for angle in turns.turned[k])
        ends = (digits(float(turns.first[k]), 6), digits(float(turns.last[k]), 6))
        rows.append([*ends, *degrees, *(residual(float(side[k])) for side in sizes)])
    header = ["from [s]", "to [s]", "outer turn [°]", "inner turn [°]", "error, over its bound", "with the effects"]
    return [Section("Turns, as the gyros saw them", [text], table=Table(header, rows))]
