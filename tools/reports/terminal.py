"""The answer of a diagnosis at a terminal: verdict, evidence, certain facts, tried explanations, advice."""

import re
import textwrap
from collections.abc import Iterator, Sequence

import numpy as np

from ..diagnosis.cause import NO_SIZES, Cause
from ..diagnosis.result import FAULTS, Diagnosis
from ..diagnosis.shortlist import rows_in_words
from ..document.notation import sentence, unit_text
from ..evidence.pairs import in_words
from ..rounding import NONE, digits, exactly, interval, residual, upwards
from ..sieve import TableRows
from . import beyond
from .evidence import proviso_of
from .noise import noise_text

WIDTH, LINES = 80, 22
"""Columns and lines of the answer; the next command takes up to three lines more of a screen."""
LABEL = 13
"""Width of the labels [columns]."""
MOST_SIZES, MOST_RIVALS, MOST_HYPOTHESES, MOST_WORST = 4, 3, 2, 4
MOST_OF_RIVALS = 12
"""Largest number of lines of explanations of which the record does not tell one."""
WIDER = 1.01
"""From this radius on a model that fits has bounds wider than σ."""
WRITTEN = ("formula", "lookup", "bias-wander")
"""Effects whose parameters have no meaning but their law."""
OF = " of "
OF_FORMULA = re.compile(r"^(c of [^:]*|Γ): ")
"""The symbol of a parameter in its formula, before its meaning."""
WEAK = 0.05
"""A record that hides errors of this size [g, rad, rad/s] cannot judge an instrument."""
PLACES = {"g": "an accelerometer", "rad": "an axis", "rad/s": "a gyro"}


def terminal_lines(result: Diagnosis, verdict: str, warnings: Sequence[str]) -> list[str]:
    """Return the answer in lines of at most 80 columns, a screen with the next command.

    No sentence is cut: entries that say least are left out whole, and a long verdict may exceed the screen.
    """
    rivals = rival_lines(result)
    if rivals:
        verdict = f"The record does not tell which of {len(result.explanations)} explanations is true."
        if proviso := proviso_of(result):
            verdict += f" {sentence(proviso)}"
    head = textwrap.wrap(verdict, WIDTH, break_on_hyphens=False)
    head += rivals
    entries, before = [], ""
    for label, text in _entries(result):
        if text:
            entries.append(_wrapped(text, "" if label == before else f"{label}:"))
            before = label
    *middle, advice = entries
    of_warnings = [line for text in warnings for line in _wrapped(text, "warning:")]
    if result.verdict == "unexplained":
        # A warning may be the only clue.
        middle = [of_warnings, *middle]
    else:
        advice += of_warnings
    while middle and len(head) + 1 + sum(map(len, middle)) + len(advice) > LINES:
        # The last entries say the least.
        middle.pop()
    return [*head, "", *(line for entry in middle for line in entry), *advice]


def rival_lines(result: Diagnosis) -> list[str]:
    """Return the explanations of an ambiguous record, each whole; as many as there is room for, the simplest first."""
    lines: list[str] = []
    if result.verdict != "ambiguous":
        return lines
    for number, explanation in enumerate(result.explanations, start=1):
        entry = _wrapped(sentence(explanation.sentence.rstrip(".")), f"{number}.")
        remaining = len(result.explanations) - number + 1
        if lines and (number > MOST_RIVALS or len(lines) + len(entry) > MOST_OF_RIVALS):
            return [*lines, f"{'':{LABEL}}{remaining} more on the report (--report)."]
        lines += entry
    return lines


def _entries(result: Diagnosis) -> Iterator[tuple[str, str]]:
    """Yield labels and texts in the order of a person's questions."""
    yield "Evidence", evidence_text(result)
    for text in certain_texts(result):
        yield "Certain", text
    for text in open_texts(result):
        yield "Not certain", text
    for text in beyond.extension_texts(result)[:1]:
        yield "Beyond", sentence(text.removeprefix("Beyond the catalogue: ").rstrip("."))
    for hypothesis in (result.hypotheses or ())[:MOST_HYPOTHESES]:
        radii = f"{residual(hypothesis.radius_before)} -> {residual(hypothesis.radius)}"
        yield "Formula", f"{hypothesis.formula}: {hypothesis.answer}; largest error over its bound {radii}."
    if result.noise is not None:
        yield "Noise", noise_text(result.noise)
    yield "Would stand", stands_text(result)
    yield "Tried", tried_text(result)
    yield "Gain", gain_text(result)
    yield "Advice", advice_text(result)


def evidence_text(result: Diagnosis) -> str:
    """Return the largest error without and with the named effects, and the bound."""
    if result.radius is None:
        return ""
    unit = "σ" if result.calibration.sigma.value is not None and result.unit is None else "times its bound"
    text = f"largest error {residual(result.radius)} {unit}"
    if result.best is not None and result.best.radius is not None:
        largest = result.best.radius
        after = f"{residual(largest if largest > WIDER else min(largest, 1.0))} {unit}"
        if unit == "σ" and largest > WIDER:
            after += " (its bound is wider than σ: see the warning)"
        if result.best.kind in ("rows", "stretch"):
            them = "it" if len(result.best.where) == 1 else "them"
            text = f"largest error {residual(result.radius)} {unit} with all rows, {after} without {them}"
        elif result.best.kind == "sigma":
            text += f" as given, {residual(result.best.radius)} of the larger σ"
        elif result.verdict == "explained":
            text += f" without this, {after} with it"
        else:
            text += f" of the model alone, {after} with the first"
    sigma = result.calibration.sigma
    if unit == "σ":
        bound = exactly(sigma.value) if sigma.kind == "bound" else upwards(sigma.value, 3)
        text += f"; the bound σ = {bound} g ({sigma.basis})"
    elif result.noise_bound_arcmin is not None:
        text += f"; the bound is {upwards(result.noise_bound_arcmin, 3)} arcmin"
    return f"{text}."


def certain_texts(result: Diagnosis) -> list[str]:
    """Return the facts that the record proves: sizes with their intervals, or a place and a quantity."""
    texts: list[str] = []
    if result.verdict == "explained" and result.best is not None:
        texts += _first_of(_sizes(result, may_be_zero=False), "on the report")
        if result.best.rows and not result.best.causes:
            count = (result.calibration.positions or 0) - len(result.best.rows)
            texts.append(f"without {rows_in_words(result.best.rows)} the other {count} fit within their bounds.")
    proven = result.proven
    if proven is not None and result.verdict in ("ambiguous", "unexplained"):
        text = f"the error is at {proven.place.replace('-', ' ')}"
        if proven.quantity:
            text += f" and depends on {in_words(proven.quantity)} alone"
        texts.append(f"{text}.")
    return texts


def is_weak(result: Diagnosis) -> bool:
    """Return true if a record is consistent with errors so large that it cannot judge an instrument."""
    sizes = [entry["size"] for entry in result.power or () if entry["size"] is not None and entry["unit"] in PLACES]
    return result.verdict == "consistent" and max(sizes, default=0.0) > WEAK


def detection_limit(result: Diagnosis) -> str:
    """Return the size from which an error outside the catalogue shows, by its place; empty if none surely shows."""
    sizes = []
    for unit, where in PLACES.items():
        of_unit = [entry["size"] for entry in result.power or () if entry["unit"] == unit and entry["size"] is not None]
        if of_unit:
            sizes.append(f"{upwards(max(of_unit), 2)} {unit} in {where}")
    return " or ".join(sizes)


def _sizes(result: Diagnosis, *, may_be_zero: bool) -> list[str]:
    """Return each named size with its interval: those that may be zero, or the others."""
    causes, texts = result.causes, []
    between = "surely between" if result.calibration.sigma.kind == "bound" else "between"
    for cause in causes:
        of = f"{cause.title}: " if len(causes) > 1 else ""
        for parameter, value, (low, high) in zip(cause.parameters, cause.values, cause.intervals, strict=True):
            is_open = low <= 0.0 <= high and not parameter.name.endswith(NO_SIZES)
            if is_open != may_be_zero:
                continue
            estimate, least, most = interval(value, low, high)
            unit = unit_text(parameter.unit) or ""
            head = f"{of}{_size_in_words(cause, parameter.name)}"
            if NONE in (least, most):
                texts.append(f"{head}: {estimate} {unit}".rstrip())
            elif may_be_zero:
                texts.append(f"{head}: may be zero, between {least} and {most} {unit}".rstrip())
            else:
                texts.append(f"{head}: {estimate}, {between} {least} and {most} {unit}".rstrip())
    return texts


def _size_in_words(cause: Cause, name: str) -> str:
    """Return the meaning of a parameter of an effect; its name if it is one of a user's formula or of a table."""
    if cause.effect in WRITTEN:
        return name
    words = {}
    for p in cause.place.definition.parameters:
        words[p.name] = OF_FORMULA.sub("", p.description).split(OF)
    # The verdict says what all sizes of an effect have in common.
    while len(words) > 1 and len({parts[0] for parts in words.values()}) == 1 and min(map(len, words.values())) > 1:
        words = {other: parts[1:] for other, parts in words.items()}
    return OF.join(words.get(name, [name]))


def _first_of(texts: Sequence[str], end: str) -> list[str]:
    """Return the first of many texts, the last of these with the number of the others and an end."""
    first = list(texts[:MOST_SIZES])
    if len(texts) > MOST_SIZES:
        first[-1] += f"; {len(texts) - MOST_SIZES} more {end}"
    return first


def open_texts(result: Diagnosis) -> list[str]:
    """Return the questions that the record leaves open, the most important first."""
    texts: list[str] = []
    if result.verdict == "explained":
        texts += _first_of(_sizes(result, may_be_zero=True), "may be zero")
    if result.level == "quantity" and result.verdict == "explained":
        texts.append("the exact law: any curve within the band of the report fits.")
    texts += [sentence(text) for text in (result.objections or ())[:1]]
    if result.verdict == "unexplained":
        # The verdict has the first reason, but where something is proven.
        texts += [sentence(text) for text in (result.not_named or ())[0 if beyond.proven_text(result) else 1 : 2]]
    if (result.verdict != "ambiguous" or not texts) and result.extension is None:
        texts += [sentence(text) for text in (result.caution or ())[:1]]
    return texts


def stands_text(result: Diagnosis) -> str:
    """Return the options with which the model would stand, alone and with effects."""
    texts = [f"with {entry.title}: {entry.option}" for entry in result.stands_with or () if entry.option]
    return f"{'; '.join(texts[:MOST_RIVALS])}." if texts else ""


def tried_text(result: Diagnosis) -> str:
    """Return the explanations that were tried."""
    if result.calibration.verdict != "falsified" and not result.tried:
        return ""
    texts = (
        ["a larger noise bound", "wrong rows", "a change between two rows"]
        if result.calibration.linearised is not None and FAULTS not in result.cut_off
        else []
    )
    if result.tried and result.cut_off_at != 1:
        texts.append(f"each of {len(result.tried)} effects alone")
    if result.cut_off_at is not None:
        largest = {1: "effects", 2: "pairs of effects", 3: "sets of three effects"}[result.cut_off_at]
        texts.append(f"only some {largest}")
    if result.suffices:
        texts.append("functions of one quantity")
    return f"{', '.join(texts)}."


def gain_text(result: Diagnosis) -> str:
    """Return the effect of the extended simulation on held-out parts, of the extension where no effect is named."""
    gain = result.gain
    if gain is None and result.extension is not None:
        gain = result.extension.gain
    if gain is None:
        return ""
    pieces = f"pieces ({gain.over})" if gain.over else "positions"
    unit = gain.unit or result.unit or "g"
    before, after = digits(gain.held_out_rms_before), digits(gain.held_out_rms_after)
    if gain.improves:
        count = gain.pieces or len(gain.rows)
        return f"on {count} held-out {pieces} the rms error falls from {before} to {after} {unit}."
    return f"none on held-out {pieces}: the rms error goes from {before} to {after} {unit}."


def advice_text(result: Diagnosis) -> str:
    """Return one advice."""
    if result.next:
        return sentence(result.next[0])
    positions = result.next_positions or ()
    if positions:
        first = positions[0]
        more = f", and {len(positions) - 1} more positions" if len(positions) > 1 else ""
        return f"measure at α {exactly(first['alpha_deg'])}°, β {exactly(first['beta_deg'])}°{more}."
    if result.verdict == "explained" and result.best is not None and result.best.causes:
        return "look for its cause; if it stays, add the effect to the simulation."
    if result.verdict == "consistent" and result.calibration.linearised is not None:
        return "calibrate."
    if is_weak(result):
        return "do not accept the instrument on this record. Take one with more moves and longer rests."
    if result.verdict == "consistent":
        return "nothing needs a change. A record with more moves and longer rests shows smaller errors."
    if result.verdict == "ambiguous":
        text = "measure again with a smaller σ: longer, or each position more often."
        return text if result.next_positions is None else f"No further position surely tells two of them apart: {text}"
    if result.verdict == "unexplained":
        return unexplained_advice(result)
    if result.verdict == "insufficient" and result.missing:
        return f"add {'; '.join(str(gap) for gap in result.missing[:2])}."
    return ""


def unexplained_advice(result: Diagnosis) -> str:
    """Return what to look at, and what to measure again: the rows that misfit most, if the record has rows."""
    table = None if result.calibration.linearised is None else TableRows.of(result.evidence)
    if table is None:
        return "look at the residuals on the report; record again with longer rests and more moves."
    if any("--mounting" in text for text in result.warnings):
        return "check --mounting and --gravity first; without the true ones nothing else can be named."
    worst = table.numbers[np.argsort(-table.excess, kind="stable")[:MOST_WORST]]
    unit = "row" if result.made_of is None or result.made_of.raw is None else "rest"
    return f"measure {unit}s {', '.join(map(str, worst.tolist()))} again: they misfit most; the report shows all."


def _wrapped(text: str, label: str) -> list[str]:
    """Return a text in lines behind its label."""
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=label.ljust(LABEL),
        subsequent_indent=" " * LABEL,
        break_on_hyphens=False,
    )
