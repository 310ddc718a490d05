"""The model of a record: its parameters in words, and as equations with their numbers."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from ...models.bench import TARGETS
from ...models.effects.gyro import matrix_formula
from ..calibration import Calibration
from ..calibration.correction import Correction
from ..diagnosis.result import Cause, Diagnosis
from ..document.blocks import Section
from ..document.equations import effect_formula, math, signed
from ..document.numbers import half_width, to_bound
from ..motion.norm import COLUMNS, ROWS

Value = tuple[float | None, float | None]
"""A target's value, None where it is open, and the bound of its error, None where there is none."""

OPEN = "?"
"""In place of a number that the readings do not determine."""

SCALE = (("X4", "X5"), ("X9", "X10"), ("X14", "X15"))
CROSS: tuple[tuple[str, ...], ...] = ((), ("X6+X8",), ("X7+X12", "X11+X13"))
BIAS = ("X16", "X17", "X18")
AXES = ("1", "2", "3")
_OWN = re.compile(r"(?P<sensor>accelerometer|gyro) (?P<kind>gamma|bias)_(?P<first>\d)(?P<second>\d?)")


PHYSICAL_WORDS = (
    (r"scale-factor-error-plus-(\d)", r"scale factor of accelerometer \1 for positive input"),
    (r"scale-factor-error-minus-(\d)", r"scale factor of accelerometer \1 for negative input"),
    (r"scale-factor-asymmetry-(\d)", r"scale-factor asymmetry of accelerometer \1"),
    (r"misalignment-(\d)(\d)", r"misalignment of accelerometer \1 towards axis \2"),
    (r"mounting-error-(\d)", r"mounting error about axis \1"),
    (r"bias-(\d)", r"bias of accelerometer \1"),
    (r"outer-axis-tilt", "tilt of the outer axis"),
    (r"outer-angle-offset", "zero of the outer angle"),
    (r"axis-nonorthogonality", "non-orthogonality of the axes"),
)
"""A target's name, and what an engineer calls it."""


def physical_words(name: str) -> str:
    """A target's name in words: "bias-1" is "bias of accelerometer 1"; the name of a mounting stays behind it."""
    for pattern, words in PHYSICAL_WORDS:
        name = re.sub(pattern, words, name)
    return name


MOST_NAMED = 5
"""So many targets that are open are named in a sentence."""


def open_targets(result: Calibration) -> str:
    """What the measurements leave open, in a sentence."""
    gaps = result.missing
    if not gaps:
        return "whether an error that holds over a rest is in them" if result.radius > 1.0 else "more than they have"
    if len(gaps) == len(result.parameters):
        return "any of the targets"
    if len(gaps) > MOST_NAMED:
        return f"{len(gaps)} of the {len(result.parameters)} targets"
    return ", ".join(physical_words(gap.name) for gap in gaps)


def missing_lines(result: Calibration) -> list[str]:
    """What the measurements leave open, in words."""
    if not result.missing:
        return []
    if len(result.missing) == len(result.parameters):
        return ["The readings determine no target. Measure the positions named, or say what is known by --prior."]
    named = ", ".join(f"{physical_words(gap.name)} ({gap.symbol})" for gap in result.missing)
    return [f"The readings do not determine: {named}. Measure the positions named, or say what is known by --prior."]


def bench_section(result: Calibration, values: Mapping[str, Value], causes: Sequence[Cause] = ()) -> Section:
    """The model of bench and block with its numbers; an extended one with its effects.

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
    if len(result.linearised.parametrisation.mountings) > 1:
        said.append(f"Table and mounting as in {result.linearised.parametrisation.mountings[0]}.")
    turn = ", ".join(number(values[symbol]) for symbol in ("X13", "-X12", "X8"))
    table = [
        "n = exp(ϑ) Q up(α − Δα, β; κ, ε)",
        f"κ = {number(values['X1'])}, Δα = {number(values['X2'])}, ε = {number(values['X3'])}",
        f"ϑ = ({turn})",
    ]
    return _section(said, [*_block(values), *table], causes)


def calibrated_values(result: Calibration) -> dict[str, Value]:
    """The targets of case (A1): estimates where there are such, else the fit."""
    here = result.linearised
    at_fit = dict(zip(TARGETS, (here.parametrisation.selection[0] @ here.point).tolist(), strict=True))
    found = {e.symbol: (e.estimate, e.guaranteed_error) for e in result.parameters if e.estimate is not None}
    values: dict[str, Value] = {symbol: (value, None) for symbol, value in at_fit.items()}
    return values | found | {gap.symbol: (None, None) for gap in result.missing}


def _block(values: Mapping[str, Value]) -> list[str]:
    """The three accelerometers."""
    lines = []
    for p in range(3):
        n = f"n_{p + 1}"
        plus, minus = (number(values[symbol]) for symbol in SCALE[p])
        choice = f"{{{plus} {n} ; 'where' {n} > 0 | {minus} {n} ; 'where' {n} < 0}}"
        terms = [f"f_{p + 1}/g = {n} +", f"({plus}) {n}" if plus == minus != OPEN else choice]
        for symbol, of in (*((s, f"n_{k + 1}") for k, s in enumerate(CROSS[p])), (BIAS[p], "")):
            text = number(values[symbol])
            terms.append(f"{'−' if text.startswith('−') else '+'} {text.lstrip('−')} {of}")
        lines.append(" ".join(terms))
    return lines


def _section(said: Sequence[str], lines: Sequence[str], causes: Sequence[Cause]) -> Section:
    more = ["The last lines are the effects by which the simulation was extended."] if causes else []
    return Section("What was simulated", [*said, *more], equations=[*map(math, lines), *cause_lines(causes)])


def cause_lines(causes: Sequence[Cause]) -> list[str]:
    """What each effect adds, as MathML; none for an effect without a formula."""
    lines = []
    for cause in causes:
        texts = {
            parameter.name: number((value, 0.5 * (high - low)))
            for parameter, value, (low, high) in zip(cause.parameters, cause.values, cause.intervals, strict=True)
        }
        formula = effect_formula(cause.place, texts)
        if formula is not None:
            lines.append(math(formula))
    return lines


def correction_lines(correction: Correction, digits: int) -> list[str]:
    """The correction of readings as MathML, with so many decimals."""
    terms = correction_terms(correction, f".{digits}f", "_")
    return [
        math(f"{n} = {t} / {{{plus} ; 'where' {n} > 0 | {minus} ; 'where' {n} < 0}}") for n, t, plus, minus in terms
    ]


def correction_terms(correction: Correction, form: str, below: str = "") -> list[tuple[str, str, str, str]]:
    """For each accelerometer its input, the reading less what is known of it, and the scales of either sign."""
    found = []
    for p in range(3):
        terms = [f"f{below}{p + 1}/g", signed(-correction.bias[p], f"{abs(correction.bias[p]):{form}}")]
        for c, g in enumerate(correction.gamma[p, :p].tolist(), start=1):
            terms.append(signed(-g, f"{abs(g):{form}} n{below}{c}"))
        plus, minus = (f"{scale[p]:{form}}" for scale in (correction.plus, correction.minus))
        found.append((f"n{below}{p + 1}", f"({' '.join(terms)})", plus, minus))
    return found


def number(value: Value) -> str:
    """A number as its bound justifies it, or the sign for one that is open."""
    written = to_bound(*value)
    return OPEN if written is None else written.text


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


def carried_section(result: Diagnosis) -> Section:
    """The model of a block that is carried: block, attitude and effects, where the result names them."""
    values: dict[str, Value] = {
        p.name: (p.estimate, half_width(p.low, p.high)) for p in result.baseline.parameters or ()
    }
    gravity = result.reference == "gravity"
    free = "biases, scale factors and misalignments" if result.baseline_model == "calibrated" else "biases"
    own = f"whose {free} are free to be what the record says"
    if result.bias_at_rest is not None:
        own = "taken as delivered: their mean at rest is taken out, and nothing else"
    said = [
        f"A block of three gyros{' and three accelerometers' if gravity else ''}, {own}. Its readings "
        "are taken back to rates by the inverse of these equations, and the rates carry the attitude q. n is the "
        "specific force in units of g, ω the rate in rad/s, both in the block's axes."
    ]
    if values:
        said.append("Numbers are rounded to what their intervals justify.")
    forces = f"f/g = n + {_triangle(values)} n + {_vector('accelerometer bias', values)} + Δf/g"
    lines = [_gyros(result, values), "dq/dt = q ∘ ω / 2"]
    if gravity:
        lines = [forces, *lines, "n 'at rest' = q⁻ ∘ up ∘ q"]
    return _section(said, lines, result.causes if result.verdict == "explained" else ())


def _gyros(result: Diagnosis, values: Mapping[str, Value]) -> str:
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
        terms.append(f"+ {_vector('gyro bias', at_rest)}")
    elif "gyro bias_1" in values:
        terms.append(f"+ {_vector('gyro bias', values)}")
    return " ".join([*terms, "+ Δω"])


def _vector(name: str, values: Mapping[str, Value]) -> str:
    """Three numbers, one for each axis."""
    return f"({', '.join(number(values.get(f'{name}_{p}', (None, None))) for p in AXES)})"


def _triangle(values: Mapping[str, Value]) -> str:
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
