"""The page of `trihedron diagnose` for a strapdown record, and its pictures for other documents."""

from pathlib import Path

import numpy as np

from ..diagnosis.result import Diagnosis
from ..diagnosis.search import compared_places, likeness
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
    left_of,
    length_section,
    next_section,
    parameter_section,
    quoted_words,
    structure_section,
    witness_section,
)
from .strapdown_text import VERDICTS, parameters_of, sentence_of, sets_of, witnesses_of

TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}
FEW_RIVALS = 3
"""Up to so many sets of effects are named in the verdict."""


def strapdown_page(result: Diagnosis) -> str:
    """The page as HTML: verdict, record, model, errors, causes, evidence, gain, what is excluded, what next."""
    return render_page(
        f"Diagnosis of {result.evidence.found.record.path.name}",
        verdict_sentence(result),
        strapdown_sections(result),
        tone=TONES.get(result.verdict, "attention"),
        key=key_figures(result),
        provenance=provenance(result),
        sources=strapdown_sources(result),
    )


def verdict_sentence(result: Diagnosis) -> str:
    """The verdict, with the causes when they are named."""
    period = result.evidence.found.sampling.period
    if result.verdict == "explained":
        return f"The simulation lacked this: {'; '.join(sentence_of(cause, period) for cause in result.causes)}."
    if result.verdict == "ambiguous":
        titles = [" and ".join(cause.place.title for cause in causes) for causes in sets_of(result)]
        few = result.complete is not False and len(titles) <= FEW_RIVALS
        rivals = " or ".join(titles) if few else f"{len(titles)} and more sets of effects"
        return f"The simulation lacks something, and the record does not say what: {rivals} would explain it."
    if result.verdict == "unexplained":
        radius = result.baseline.radius or 0.0
        said = f"The simulation lacks something: its largest error is {radius:.3g} times its bound, "
        return (
            said + ("and " + result.not_named[0] if result.not_named else "and nothing in the catalogue mends it") + "."
        )
    if result.verdict == "insufficient" and result.missing:
        return f"Too little was measured to judge the simulation. To add: {'; '.join(map(str, result.missing))}."
    if result.verdict == "consistent" and result.baseline.radius is not None:
        return (
            "Consistent: the simulation explains the record within its noise; no error is more than "
            f"{result.baseline.radius:.2g} of its bound, and no effect is named."
        )
    return VERDICTS[result.verdict].capitalize() + "."


def key_figures(result: Diagnosis) -> dict[str, object]:
    """What stands below the verdict."""
    key: dict[str, object] = {"rows": len(result.evidence.found.record), "reference": result.reference}
    if result.baseline.radius is None or result.noise_bound_arcmin is None:
        return key
    key |= {f"bound, {quoted_words(result)}": f"{result.noise_bound_arcmin:.3g} arcmin"}
    key |= {"largest error": f"{result.baseline.radius:.3g} of its bound"}
    if result.causes and result.extended is not None:
        key |= {"with the effect" if len(result.causes) == 1 else "with the effects": f"{result.extended.radius:.3g}"}
    return key


def strapdown_sections(result: Diagnosis) -> list[Section]:
    """Every section that the result has something for."""
    sections = measured_sections(result)
    if result.evidence.parts:
        sections += [model_section(result), *error_sections(result)]
    if result.causes:
        sections.append(cause_section(result))
    if parameters_of(result):
        sections.append(parameter_section(result))
    sections += [*ranking_sections(result), *confusion_sections(result)]
    if result.lengths or ():
        sections.append(length_section(result))
    if result.gain is not None:
        sections.append(gain_section(result))
    if witnesses_of(result) or result.not_named:
        sections.append(witness_section(result))
    if result.residual_structure or ():
        sections.append(structure_section(result))
    sections += excluded_sections(result)
    if result.next or ():
        sections.append(next_section(result))
    return sections


def ranking_sections(result: Diagnosis) -> list[Section]:
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


def confusion_sections(result: Diagnosis) -> list[Section]:
    """What could be taken for what in this record, and the classes; a section, or none."""
    if not result.tried:
        return []
    sets, ranked = [finding.fit.places for finding in result.findings], [title for title, _ in result.tried]
    compared = compared_places(result.evidence.classes.places, sets, ranked)
    if len(compared) < 2:
        return []
    rows: list[list[Cell]] = [
        [cause.place.title, ", ".join(place.title for place in cause.alike)]
        for finding in result.findings
        for cause in finding.causes
        if cause.equivalents
    ]
    imitated = ", beyond what the block's own parameters imitate" if parameters_of(result) else ""
    said = [ALIKE.format(f"in this record{imitated}")]
    if result.causes and not rows:
        said.append("What was found is alone in its class: this record tells it from every other effect.")
    return [
        Section(
            CONFUSION,
            said,
            likeness_picture([place.title for place in compared], likeness(result.evidence, compared)),
            "Cosine of the least angle between what two effects add to the errors.",
            Table(["effect", "nothing in this record tells it from"], unrepeated(rows)) if rows else None,
        )
    ]


def provenance(result: Diagnosis) -> dict[str, object]:
    """What the result rests on: record, options, versions, seeds."""
    record = result.evidence.found.record
    given: dict[str, object] = {"record": record.path.name, "record, SHA-256": record.sha256}
    given |= {"reference": result.reference, "gravity": f"{result.evidence.found.gravity:.8g} m/s²"}
    given["model"] = f"{result.baseline_model} block"
    if record.rate is not None:
        given["a rate in the record is"] = result.evidence.rates
    if result.noise_bound_from:
        given["bounds from"] = result.noise_bound_from
    if witnesses_of(result):
        given["seed of the shuffles"] = sum(part.error.size for part in result.evidence.parts)
    return given | versions()


def pictures(result: Diagnosis) -> dict[str, str]:
    """The page's pictures by name, for other documents: name -> SVG."""
    part = result.evidence.parts[result.evidence.quoted]
    time = result.evidence.found.record.time_s
    middle = 0.5 * (time[part.pieces.first] + time[part.pieces.last])
    after = left_of(result)
    found = {
        "time": errors_over_time(np.asarray(middle), part.error, after, part.bound, quoted_words(result)),
        "quantities": errors_over_quantities(result.evidence.quantities(), part.error, after),
    }
    orders = [(length.over, length.order) for length in result.lengths or () if length.order is not None]
    if orders:
        found["order"] = order_picture(orders)
    if result.gain is not None:
        found["gain"] = gain_picture(result.gain.before, result.gain.after, result.gain.to_json()["over"])
    return found


def write_pictures(result: Diagnosis, folder: Path, stem: str) -> list[Path]:
    """Write the pictures as <stem>-<name>.svg into a folder."""
    from ..files import write_text

    written = []
    for name, svg in pictures(result).items():
        written.append(folder / f"{stem}-{name}.svg")
        write_text(written[-1], svg)
    return written
