"""The model of a record as equations with its numbers."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from ...models.bench import TARGETS
from ...models.effects import CATALOGUE
from ...models.effects.definition import matrix_formula
from ..calibration import Calibration
from ..calibration.correction import Correction
from ..diagnosis.result import Cause, Diagnosis
from ..document.blocks import Section
from ..document.equations import effect_formula, math, signed
from ..document.numbers import half_width, to_bound
from ..motion.norm import COLUMNS, ROWS
from .words import parameters_of

Value = tuple[float | None, float | None]
"""A target's value, None where it is open, and the bound of its error, None where there is none."""

OPEN = "?"
"""In place of a number that the readings do not determine."""

SCALE = (("X4", "X5"), ("X9", "X10"), ("X14", "X15"))
CROSS: tuple[tuple[str, ...], ...] = ((), ("X6+X8",), ("X7+X12", "X11+X13"))
BIAS = ("X16", "X17", "X18")


def model_section(result: Calibration, values: Mapping[str, Value], causes: Sequence[Cause] = ()) -> Section:
    """The model with its numbers; an extended one with its effects.

    Parameters
    ----------
    result : Calibration
    values : mapping
        target of case (A1) -> value
    causes : sequence of Cause
        effects of the extended model
    """
    scales = "of either sign" if result.baseline == "asymmetric" else "the same for both signs"
    said = [
        "The bench: a block of three accelerometers with biases, misalignments and scale factors "
        f"{scales}, mounted on a table whose axes are not quite horizontal and perpendicular. n is what the "
        "accelerometers feel, in units of g; angles are in radians. Numbers are rounded to what their guaranteed "
        "errors justify.",
    ]
    if any(value is None for value, _ in values.values()):
        said.append("A question mark stands for what the readings do not determine.")
    if causes:
        said.append("The last lines are the effects by which the model was extended.")
    if len(result.linearised.parametrisation.mountings) > 1:
        said.append(f"Table and mounting as in {result.linearised.parametrisation.mountings[0]}.")
    return Section(
        "What was simulated", said, equations=[*block_lines(values), *bench_lines(values), *cause_lines(causes)]
    )


def calibrated_values(result: Calibration) -> dict[str, Value]:
    """The targets of case (A1): estimates where there are such, else the fit."""
    here = result.linearised
    at_fit = dict(zip(TARGETS, (here.parametrisation.selection[0] @ here.point).tolist(), strict=True))
    found = {e.symbol: (e.estimate, e.guaranteed_error) for e in result.parameters if e.estimate is not None}
    values: dict[str, Value] = {symbol: (value, None) for symbol, value in at_fit.items()}
    return values | found | {gap.symbol: (None, None) for gap in result.missing}


def extended_values(result: Diagnosis) -> dict[str, Value]:
    """The targets with the effects that were found, else those of the nominal model."""
    values = calibrated_values(result.evidence.calibration)
    for target in result.targets or ():
        if target["symbol"] in values:
            values[target["symbol"]] = target["after"], half_width(target["low"], target["high"])
    return values


def block_lines(values: Mapping[str, Value]) -> list[str]:
    """The three accelerometers."""
    lines = []
    for p in range(3):
        n = f"n_{p + 1}"
        plus, minus = (_text(values[symbol]) for symbol in SCALE[p])
        choice = f"{{{plus} {n} ; 'where' {n} > 0 | {minus} {n} ; 'where' {n} < 0}}"
        own = f"({plus}) {n}" if plus == minus != OPEN else choice
        terms = [f"f_{p + 1}/g = {n} + {own}"]
        terms += [_term(values[symbol], f"n_{k + 1}") for k, symbol in enumerate(CROSS[p])]
        terms.append(_term(values[BIAS[p]], ""))
        lines.append(math(" ".join(terms)))
    return lines


def bench_lines(values: Mapping[str, Value]) -> list[str]:
    """Table and mounting."""
    turn = ", ".join(_text(values[symbol]) for symbol in ("X13", "-X12", "X8"))
    return [
        math("n = exp(ϑ) Q up(α − Δα, β; κ, ε)"),
        math(f"κ = {_text(values['X1'])}, Δα = {_text(values['X2'])}, ε = {_text(values['X3'])}"),
        math(f"ϑ = ({turn})"),
    ]


def cause_lines(causes: Sequence[Cause]) -> list[str]:
    """What each effect adds; none for an effect without a formula."""
    lines = []
    for cause in causes:
        names = [parameter.name for parameter in CATALOGUE[cause.place.effect].at(cause.place).parameters]
        texts = {}
        for name, value, (low, high) in zip(names, cause.values, cause.intervals, strict=True):
            written = to_bound(value, 0.5 * (high - low))
            texts[name] = OPEN if written is None else written.text
        formula = effect_formula(cause.place, texts)
        if formula is not None:
            lines.append(math(formula))
    return lines


def correction_lines(correction: Correction, digits: int) -> list[str]:
    """The correction of readings, with so many decimals."""
    lines = []
    for p in range(3):
        n = f"n_{p + 1}"
        terms = [f"f_{p + 1}/g", signed(-correction.bias[p], f"{abs(correction.bias[p]):.{digits}f}")]
        terms += [signed(-g, f"{abs(g):.{digits}f} n_{c + 1}") for c, g in enumerate(correction.gamma[p, :p].tolist())]
        plus, minus = (f"{scale[p]:.{digits}f}" for scale in (correction.plus, correction.minus))
        lines.append(math(f"{n} = ({' '.join(terms)}) / {{{plus} ; 'where' {n} > 0 | {minus} ; 'where' {n} < 0}}"))
    return lines


def _text(value: Value) -> str:
    written = to_bound(*value)
    return OPEN if written is None else written.text


def _term(value: Value, of: str) -> str:
    text = _text(value)
    return f"{'−' if text.startswith('−') else '+'} {text.lstrip('−')} {of}"


AXES = ("1", "2", "3")

_OWN = re.compile(r"(?P<sensor>accelerometer|gyro) (?P<kind>gamma|bias)_(?P<first>\d)(?P<second>\d?)")


def own_words(name: str) -> str:
    """A parameter of the block in words: "gyro gamma_12" is the misalignment of gyro 1 towards axis 2."""
    match = _OWN.fullmatch(name)
    if match is None:
        return name
    sensor = f"{match['sensor']} {match['first']}"
    if match["kind"] == "bias":
        return f"bias of {sensor}"
    same = match["first"] == match["second"]
    return f"scale factor of {sensor}" if same else f"misalignment of {sensor} towards axis {match['second']}"


def carried_model_section(result: Diagnosis) -> Section:
    """Block, attitude and effects; those of the first set where the result names one."""
    values = own_values(result)
    gravity = result.reference == "gravity"
    named = result.causes if result.verdict == "explained" else ()
    said = [
        f"A block of three gyros{' and three accelerometers' if gravity else ''}, {own_errors(result)}. Its readings "
        "are taken back to rates by the inverse of these equations, and the rates carry the attitude q. n is the "
        "specific force in units of g, ω the rate in rad/s, both in the block's axes."
    ]
    if values:
        said.append("Numbers are rounded to what their intervals justify.")
    if named:
        said.append("The last lines are the effects by which the simulation was extended.")
    lines = []
    if gravity:
        lines += [math(f"f/g = n + {triangle(values)} n + {vector('accelerometer bias', values)} + Δf/g")]
    lines += [math(gyro_line(result, values)), math("dq/dt = q ∘ ω / 2")]
    if gravity:
        lines += [math("n 'at rest' = q⁻ ∘ up ∘ q")]
    return Section("What was simulated", said, equations=[*lines, *effect_lines(named)])


def own_errors(result: Diagnosis) -> str:
    """What belongs to the block itself, in words."""
    if result.bias_at_rest is not None:
        return "taken as delivered: their mean at rest is taken out, and nothing else"
    free = "biases, scale factors and misalignments" if result.baseline_model == "calibrated" else "biases"
    return f"whose {free} are free to be what the record says"


def own_values(result: Diagnosis) -> dict[str, Value]:
    """The block's own parameters: name -> value and half of its interval, None where there is none."""
    return {
        p.name: (p.estimate, None if p.low is None or p.high is None else 0.5 * (p.high - p.low))
        for p in parameters_of(result)
    }


def gyro_line(result: Diagnosis, values: Mapping[str, Value]) -> str:
    """What the gyros read."""
    terms = ["ω_read = ω"]
    if "gyro gamma_11" in values:
        own = {f"gamma_{p}{q}": number(values[f"gyro gamma_{p}{q}"]) for p in AXES for q in AXES}
        terms.append(f"+ {matrix_formula('gamma', AXES).format(**own)} ω")
    if result.bias_at_rest is not None:
        bounds = result.evidence.found.rests.rate_bound
        near = [None] * 3 if bounds is None else [float(b) for b in np.median(bounds, axis=0)]
        # It is no parameter that is fitted: the noise at rest says how well it is known.
        at_rest = {f"gyro bias_{p + 1}": (float(result.bias_at_rest.radps[p]), near[p]) for p in range(3)}
        terms.append(f"+ {vector('gyro bias', at_rest)}")
    elif "gyro bias_1" in values:
        terms.append(f"+ {vector('gyro bias', values)}")
    return " ".join([*terms, "+ Δω"])


def vector(name: str, values: Mapping[str, Value]) -> str:
    """Three numbers, one for each axis."""
    return f"({', '.join(number(values.get(f'{name}_{p}', (None, None))) for p in (1, 2, 3))})"


def triangle(values: Mapping[str, Value]) -> str:
    """The accelerometers' matrix: its first axis is the first accelerometer's, so that nothing stands above."""
    below = {(int(r), int(c)) for r, c in zip(ROWS, COLUMNS, strict=True)}
    rows = (
        " ; ".join(
            number(values.get(f"accelerometer gamma_{r + 1}{c + 1}", (None, None))) if (r, c) in below else "0"
            for c in range(3)
        )
        for r in range(3)
    )
    return f"[{' | '.join(rows)}]"


def number(value: Value) -> str:
    """A number as its bound justifies it, or the sign for one that is open."""
    written = to_bound(*value)
    return OPEN if written is None else written.text


def effect_lines(causes: Sequence[Cause]) -> list[str]:
    """What each effect adds, as MathML."""
    lines = []
    for cause in causes:
        names = [parameter.name for parameter in CATALOGUE[cause.place.effect].at(cause.place).parameters]
        numbers = {
            name: number((value, 0.5 * (high - low)))
            for name, value, (low, high) in zip(names, cause.values, cause.intervals, strict=True)
        }
        formula = effect_formula(cause.place, numbers)
        if formula is not None:
            lines.append(math(formula))
    return lines
