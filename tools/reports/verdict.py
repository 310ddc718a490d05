"""The verdict of a diagnosis in words, whatever the record: what is named, what else would do, what was not tried."""

from ..diagnosis.cause import Cause, Finding
from ..diagnosis.result import Diagnosis
from ..document.notation import sentence
from ..rounding import digits, residual
from . import bench, beyond, evidence

FEW_RIVALS = 3
"""Up to so many sets of effects are named in the verdict."""
OTHERS_MAY = "and others may that were not tried: the search was cut off"
MOST_SETS = 6
"""So many sets that remain are printed."""


def verdict_sentence(result: Diagnosis) -> str:
    """The verdict, with the cause when one is named, and on whose word it rests."""
    proviso = evidence.as_stated(result)
    return f"{_verdict(result)} {sentence(proviso)}" if proviso else _verdict(result)


LACKS = "The simulation lacks something"


def _verdict(result: Diagnosis) -> str:
    if result.verdict == "explained":
        return f"The simulation lacked this: {sentences_of(result.findings[0], result)}."
    if result.verdict == "ambiguous":
        return _ambiguous(result)
    if result.verdict == "unexplained":
        return _unexplained(result)
    if result.verdict == "insufficient":
        return f"Too little was measured to judge the simulation: {missing_words(result)}."
    return (
        "Consistent: the simulation explains the record within its noise; no error is more than "
        f"{residual(result.radius or 0.0)} of its bound, and no effect is named."
    )


def _ambiguous(result: Diagnosis) -> str:
    """Return which sets would explain the record, and what speaks against the first."""
    text = f"{LACKS}, and the record does not say what: {rivals(result)}"
    if result.objections:
        text += f" But {result.objections[0]}."
    if only_unlisted(result):
        text += f" {sentence(result.caution[0])}"
    return text


def _unexplained(result: Diagnosis) -> str:
    """Return what is known of a record that nothing explains: an objection, a cut-off, a place, or the residual."""
    least = f"with the best parameters its largest error is {residual(result.radius or 0.0)} times its bound"
    if result.not_named:
        return f"{LACKS}: {least}, and {result.not_named[0]}."
    if result.cut_off_at is not None:
        return f"{LACKS}: {least}. {sentence(cut_off(result.cut_off_at))}"
    proven = beyond.proven_text(result)
    if proven:
        return f"{LACKS}, and what is {proven}."
    text = f"{LACKS} that is not in the catalogue: {least}, and no set of up to three effects mends it."
    return f"{text} {beyond.beyond_words(result)}".rstrip()


def missing_words(result: Diagnosis) -> str:
    """Return what is to be added, or which targets are left open."""
    texts = [gap for gap in result.missing or () if isinstance(gap, str)]
    if texts:
        return f"to add: {'; '.join(texts)}"
    return f"the readings do not determine {bench.open_targets(result.evidence.calibration)}"


def rivals(result: Diagnosis) -> str:
    """Return the sets of effects that remain, few by their names, and what further positions would do."""
    sets = sets_of(result)
    text = f"{len(sets)} sets of effects would explain it"
    if len(sets) <= FEW_RIVALS:
        text = f"{' or '.join([finding.title for finding in sets])} would explain it"
    if result.cut_off_at is not None:
        text += f", {OTHERS_MAY}"
    proposed = len(result.next_positions or ())
    if not proposed:
        return f"{text}."
    sure = len(bench.deciding(result.evidence.calibration.linearised, result.next_positions or ()))
    if sure == proposed:
        positions = "position decides" if proposed == 1 else "positions decide"
        return f"{text}. Readings at {proposed} further {positions}."
    tells = {0: "none surely tells", 1: "one surely tells"}.get(sure, f"{sure} surely tell")
    return f"{text}. Of {proposed} further positions that are proposed {tells} two of them apart."


def sets_of(result: Diagnosis) -> tuple[Finding, ...]:
    """The sets that remain, the best first; one where a cause is named."""
    return result.findings if result.verdict in ("explained", "ambiguous") else ()


def sentence_of(cause: Cause, result: Diagnosis) -> str:
    """What an engineer is told of a cause; latency also in samples."""
    if cause.place.effect == "latency":
        return f"{cause.sentence}, {digits(abs(cause.values[0]) / result.evidence.found.sampling.period)} samples"
    return cause.sentence


def sentences_of(finding: Finding, result: Diagnosis) -> str:
    """What an engineer is told of the causes of a set."""
    return "; ".join(sentence_of(cause, result) for cause in finding.causes)


def cut_off(size: int) -> str:
    """That the search was cut off among sets of a size, and after what."""
    smaller = {1: "", 2: "no single effect will do; ", 3: "no set of one or two effects will do; "}[size]
    sets = {1: "single effects", 2: "sets of two", 3: "sets of three"}[size]
    return f"the search was cut off: {smaller}{sets} were not all tried"


def only_unlisted(result: Diagnosis) -> bool:
    """Whether a record is ambiguous only by what is in no catalogue."""
    alone = result.verdict == "ambiguous" and not result.alternatives and result.complete is not False
    return alone and bool(result.caution)
