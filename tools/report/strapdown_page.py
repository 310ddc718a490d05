"""The page of `trihedron diagnose` for a strapdown record, and its pictures for other documents."""

from pathlib import Path

import numpy as np

from ..evidence.gain import ARCMIN
from ..strapdown.result import StrapdownDiagnosis
from ..strapdown.summary import VERDICTS, sentence_of
from .cells import Cell
from .diagnosis_pictures import candidates
from .evidence_sections import ALIKE, CONFUSION, MOST_RANKED, how_many_mend, unrepeated
from .likeness_picture import likeness_picture
from .page import Section, Table, Tone, render_page
from .record_sections import versions
from .sources import strapdown_sources
from .strapdown_excluded import excluded_sections
from .strapdown_measured import measured_sections
from .strapdown_model import model_section
from .strapdown_pictures import errors_over_quantities, errors_over_time, gain_picture, order_picture
from .strapdown_sections import (
    cause_section,
    error_sections,
    gain_section,
    length_section,
    next_section,
    parameter_section,
    quoted_words,
    structure_section,
    witness_section,
)

TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}
FEW_RIVALS = 3
"""Up to so many sets of effects are named in the verdict."""


def strapdown_page(result: StrapdownDiagnosis) -> str:
    """The page as HTML: verdict, record, model, errors, causes, evidence, gain, what is excluded, what next."""
    return render_page(
        f"Diagnosis of {result.inspection.record.path.name}",
        verdict_sentence(result),
        strapdown_sections(result),
        tone=TONES.get(result.verdict, "attention"),
        key=key_figures(result),
        provenance=provenance(result),
        sources=strapdown_sources(result),
    )


def verdict_sentence(result: StrapdownDiagnosis) -> str:
    """The verdict, with the causes when they are named."""
    period = result.inspection.sampling.period
    if result.verdict == "explained":
        return f"The simulation lacked this: {'; '.join(sentence_of(cause, period) for cause in result.causes)}."
    if result.verdict == "ambiguous":
        titles = [" and ".join(cause.place.title for cause in causes) for causes in result.candidates]
        few = result.complete and len(titles) <= FEW_RIVALS
        rivals = " or ".join(titles) if few else f"{len(titles)} and more sets of effects"
        return f"The simulation lacks something, and the record does not say what: {rivals} would explain it."
    if result.verdict == "unexplained":
        said = f"The simulation lacks something: its largest error is {result.radius or 0.0:.3g} times its bound, "
        return (
            said
            + ("and " + result.objections[0] if result.objections else "and nothing in the catalogue mends it")
            + "."
        )
    if result.verdict == "insufficient" and result.missing:
        return f"Too little was measured to judge the simulation. To add: {'; '.join(result.missing)}."
    if result.verdict == "consistent" and result.radius is not None:
        return (
            "Consistent: the simulation explains the record within its noise; no error is more than "
            f"{result.radius:.2g} of its bound, and no effect is named."
        )
    return VERDICTS[result.verdict].capitalize() + "."


def key_figures(result: StrapdownDiagnosis) -> dict[str, object]:
    """What stands below the verdict."""
    key: dict[str, object] = {"rows": len(result.inspection.record), "reference": result.reference}
    if result.radius is None or result.noise_bound is None:
        return key
    key |= {f"bound, {quoted_words(result)}": f"{result.noise_bound / ARCMIN:.3g} arcmin"}
    key |= {"largest error": f"{result.radius:.3g} of its bound"}
    if result.causes and result.extended_radius is not None:
        key |= {"with the effect" if len(result.causes) == 1 else "with the effects": f"{result.extended_radius:.3g}"}
    return key


def strapdown_sections(result: StrapdownDiagnosis) -> list[Section]:
    """Every section that the result has something for."""
    sections = measured_sections(result)
    if result.parts:
        sections += [model_section(result), *error_sections(result)]
    if result.causes:
        sections.append(cause_section(result))
    if result.parameters:
        sections.append(parameter_section(result))
    sections += [*ranking_sections(result), *confusion_sections(result)]
    if result.lengths:
        sections.append(length_section(result))
    if result.gain is not None:
        sections.append(gain_section(result))
    if result.witnesses or result.objections:
        sections.append(witness_section(result))
    if result.residual_structure:
        sections.append(structure_section(result))
    sections += excluded_sections(result)
    if result.separate:
        sections.append(next_section(result))
    return sections


def ranking_sections(result: StrapdownDiagnosis) -> list[Section]:
    """What each effect by itself would leave; a section, or none."""
    if not result.tried:
        return []
    shown = result.tried[:MOST_RANKED]
    return [
        Section(
            "Evidence: which effect mends it",
            [
                f"Each of the {len(result.tried)} effects that this record can show was added to the simulation in "
                f"turn. At or below one every error is within its bound. {how_many_mend(result.tried)}"
            ],
            candidates([title for title, _ in shown], [radius for _, radius in shown], "largest error over its bound"),
            f"Least largest error that each effect leaves, over its bound; the best {len(shown)}.",
        )
    ]


def confusion_sections(result: StrapdownDiagnosis) -> list[Section]:
    """What could be taken for what in this record, and the classes; a section, or none."""
    if result.alike is None or len(result.compared) < 2:
        return []
    rows: list[list[Cell]] = [
        [cause.place.title, ", ".join(place.title for place in cause.alike)]
        for causes in result.candidates
        for cause in causes
        if cause.equivalents
    ]
    imitated = ", beyond what the block's own parameters imitate" if result.parameters else ""
    said = [ALIKE.format(f"in this record{imitated}")]
    if result.causes and not rows:
        said.append("What was found is alone in its class: this record tells it from every other effect.")
    return [
        Section(
            CONFUSION,
            said,
            likeness_picture([place.title for place in result.compared], result.alike),
            "Cosine of the least angle between what two effects add to the errors.",
            Table(["effect", "nothing in this record tells it from"], unrepeated(rows)) if rows else None,
        )
    ]


def provenance(result: StrapdownDiagnosis) -> dict[str, object]:
    """What the result rests on: record, options, versions, seeds."""
    record = result.inspection.record
    given: dict[str, object] = {"record": record.path.name, "record, SHA-256": record.sha256}
    given |= {"reference": result.reference, "gravity": f"{result.inspection.gravity:.8g} m/s²"}
    given["model"] = f"{result.baseline} block"
    if record.rate is not None:
        given["a rate in the record is"] = result.rates
    if result.noise_bound_from:
        given["bounds from"] = result.noise_bound_from
    if result.witnesses:
        given["seed of the shuffles"] = sum(part.error.size for part in result.parts)
    return given | versions()


def pictures(result: StrapdownDiagnosis) -> dict[str, str]:
    """The page's pictures by name, for other documents: name -> SVG."""
    part = result.parts[result.quoted]
    time = result.inspection.record.time_s
    middle = 0.5 * (time[part.pieces.first] + time[part.pieces.last])
    after = result.left[result.quoted] if result.causes else None
    found = {
        "time": errors_over_time(np.asarray(middle), part.error, after, part.bound, quoted_words(result)),
        "quantities": errors_over_quantities(result.quantities, part.error, after),
    }
    orders = [length.order for length in result.lengths if length.order is not None]
    if orders:
        found["order"] = order_picture(orders)
    if result.gain is not None:
        found["gain"] = gain_picture(result.gain.before, result.gain.after, result.gain.to_json()["over"])
    return found


def write_pictures(result: StrapdownDiagnosis, folder: Path, stem: str) -> list[Path]:
    """Write the pictures as <stem>-<name>.svg into a folder."""
    from ..files import write_text

    written = []
    for name, svg in pictures(result).items():
        written.append(folder / f"{stem}-{name}.svg")
        write_text(written[-1], svg)
    return written
