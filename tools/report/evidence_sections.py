"""What speaks for a verdict: the readings that prove it, the ranking of effects, what could be taken for what."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..calibration import Calibration
from ..calibration.estimates import chebyshev_centre
from ..diagnosis import Diagnosis
from ..diagnosis.search import compared_places, likeness
from ..evidence.bench_effects import is_linear
from ..evidence.evidence import Fit
from .cells import Cell
from .diagnosis_pictures import candidates
from .likeness_picture import likeness_picture
from .page import Section, Table
from .rounding import Written, minus

MOST_RANKED = 16
CONFUSION = "Evidence: what could be taken for what"
ALIKE = (
    "How alike effects look {}: 1 means that the one can be sized to look just like the other, 0 that it cannot at "
    "all. Close to 1 it takes small noise to confuse them."
)


def centred(residual: NDArray, bound: NDArray, fit: Fit | None) -> NDArray:
    """Residuals (N, 3) over their bounds; of an extended fit, at its Chebyshev centre."""
    left = residual if fit is None else fit.left
    return (left / bound).reshape(-1, 3)


def proved(result: Calibration, numbers: NDArray) -> NDArray:
    """Readings (N, 3) of bool that prove a falsification; `numbers` are the record's own of its rows."""
    witness = {(reading.position, reading.accelerometer) for reading in result.witness}
    proof = np.zeros((len(result.linearised.reading), 3), dtype=bool)
    for i, axis in np.ndindex(*proof.shape):
        proof[i, axis] = (int(numbers[i]), axis + 1) in witness
    return proof


def centre_residual(result: Calibration) -> NDArray:
    """Residuals (N, 3) [g] where the largest of them, in units of its bound, is least."""
    here = result.linearised
    return here.residual_at(chebyshev_centre(here)[1]).reshape(-1, 3)


def witness_section(result: Calibration, numbers: NDArray) -> list[Section]:
    """The readings that prove that no parameters fit; a section, or none."""
    if not result.witness:
        return []
    here = result.linearised
    left = centre_residual(result) / here.bound.reshape(-1, 3)
    rows: list[list[Cell]] = [
        [
            int(numbers[i]),
            int(axis) + 1,
            Written(minus(f"{np.degrees(here.positions.alpha[i]):.4f}")),
            Written(minus(f"{np.degrees(here.positions.beta[i]):.4f}")),
            Written(minus(f"{here.input[i, axis]:.3f}")),
            Written(minus(f"{left[i, axis]:+.2f}")),
        ]
        for i, axis in np.argwhere(proved(result, numbers))
    ]
    return [
        Section(
            "Evidence: the readings that prove it",
            [
                f"These {len(result.witness)} readings alone, whatever the others are, cannot all be within "
                f"{result.radius:.3g} σ of any parameters' prediction. If one of them is known to be spoilt, leave its "
                "row out and look again."
            ],
            table=Table(
                ["position", "accelerometer", "α [deg]", "β [deg]", "its input [g]", "at best off by [σ]"], rows
            ),
        )
    ]


def ranking_section(result: Diagnosis) -> list[Section]:
    """What each effect would leave; a section, or none."""
    if not result.tried:
        return []
    shown = result.tried[:MOST_RANKED]
    return [
        Section(
            "Evidence: which effect mends it",
            [
                f"Each of the {len(result.tried)} effects of the catalogue that are linear was added to the model in "
                f"turn. At or below one σ the extended model explains every reading. {how_many_mend(result.tried)}",
                *refused_words(result),
            ],
            candidates([title for title, _ in shown], [radius for _, radius in shown]),
            f"Least largest residual that each effect leaves, in units of σ; the best {len(shown)}.",
        )
    ]


def how_many_mend(tried: Sequence[tuple[str, float]]) -> str:
    """How many effects, each with the radius that it leaves, bring everything within its bound."""
    mending = sum(radius <= 1.0 for _, radius in tried)
    return {0: "None of them does.", 1: "One does."}.get(mending, f"{mending} do.")


def refused_words(result: Diagnosis) -> list[str]:
    """How many effects mend the record by themselves and are still not among the sets that remain; none where none."""
    remaining = {
        place.title
        for finding in result.findings
        if len(finding.causes) == 1
        for cause in finding.causes
        for place in (cause.place, *cause.alike)
    }
    refused = sum(radius <= 1.0 and title not in remaining for title, radius in result.tried)
    if not refused or not remaining:
        return []
    which = "One of them is" if refused == 1 else f"{refused} of them are"
    return [
        f"{which} not among the sets that remain: only a size that is not possible, or only to first order, mends it."
    ]


def confusion_section(result: Diagnosis) -> list[Section]:
    """What could be taken for what at these positions, and the classes; a section, or none."""
    places = compared(result)
    if len(places) < 2:
        return []
    alike = likeness(result.evidence, places)
    rows: list[Sequence[Cell]] = [
        [cause.place.title, ", ".join(e.title for e in cause.alike)]
        for finding in result.findings
        for cause in finding.causes
        if cause.equivalents
    ]
    rows += [
        ["the set that was named", " and ".join(place.title for place in members)] for members in result.equal_sets
    ]
    said = [ALIKE.format("at the positions of this record, beyond what the model's parameters imitate")]
    if result.findings and not rows:
        said.append("What was found is alone in its class: some measurement on this bench tells it from every other.")
    return [
        Section(
            CONFUSION,
            said,
            likeness_picture([place.title for place in places], alike),
            "Cosine of the least angle between what two effects add to the readings.",
            Table(["effect", "no measurement with these mountings tells it from"], unrepeated(rows)) if rows else None,
        )
    ]


def unrepeated(rows: Sequence[Sequence[Cell]]) -> list[Sequence[Cell]]:
    """The rows, each once."""
    return [row for k, row in enumerate(rows) if row not in rows[:k]]


def compared(result: Diagnosis) -> tuple[EffectPlace, ...]:
    """The effects that were found, then the best ranked ones; those with a signature."""
    places = [place for place in result.evidence.places if is_linear(place) and place.effect != "outlier"]
    titles = [title for title, _ in result.tried]
    return compared_places(places, [finding.places for finding in result.findings], titles)
