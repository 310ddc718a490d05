"""The page of `trihedron calibrate`."""

import numpy as np
from numpy.typing import NDArray

from ..calibration import Calibration
from ..records import PositionRecord
from ..summaries import open_targets
from .calibration_pictures import residuals
from .calibration_sections import joint_set_sections, levelling_sections, rest_sections
from .evidence_sections import centre_residual, proved, witness_section
from .model_sections import calibrated_values, model_section
from .next_sections import next_sections
from .page import Section, Tone, render_page
from .record_sections import key_figures, measured_section, provenance
from .rounding import significant
from .sources import calibration_sources
from .target_sections import target_section

TONES: dict[str, Tone] = {"consistent": "good"}


def calibration_page(result: Calibration, record: PositionRecord) -> str:
    """The page as HTML: verdict, record, model, residuals, targets, evidence, what next, provenance."""
    return render_page(
        f"Calibration of {record.path.name}",
        calibration_verdict(result),
        [
            measured_section(record, result, rests=len(record.rests) if record.raw is not None else None),
            model_section(result, calibrated_values(result)),
            residual_section(result, record.position),
            target_section(result),
            *witness_section(result, record.position),
            *next_sections(result.linearised, result.next_positions),
            *levelling_sections(result),
            *joint_set_sections(result),
            *rest_sections(record),
        ],
        tone=TONES.get(result.verdict, "attention"),
        key=key_figures(result),
        provenance=provenance(result),
        sources=calibration_sources(result),
    )


def calibration_verdict(result: Calibration) -> str:
    """The verdict in a sentence with its figures."""
    if result.verdict == "falsified":
        return (
            f"Falsified: no parameters of the model keep every reading within the noise bound; the best leave "
            f"{result.radius:.3g} σ, and {len(result.witness)} readings alone prove it."
        )
    if result.verdict == "insufficient":
        return f"Insufficient: the readings do not determine {open_targets(result)}."
    worst = [e for e in result.parameters if e.estimate is not None and e.guaranteed_error is not None]
    told = ""
    if worst:
        largest = max(e.guaranteed_error for e in worst if e.guaranteed_error is not None)
        told = f", and all {len(worst)} targets are known, each to within {largest:.1e} or better"
    return f"Consistent: the model explains every reading within {result.radius:.2g} σ{told}."


def residual_section(result: Calibration, numbers: NDArray) -> Section:
    """What is left of the readings: an ideal bench, and the calibrated one, within the noise band."""
    here = result.linearised
    ideal = here.residual_at(np.zeros(len(here.point))).reshape(-1, 3)
    left = centre_residual(result)
    rms = [significant(float(np.sqrt(np.mean(values**2)))) for values in (ideal, left)]
    most = [significant(float(np.abs(values).max())) for values in (ideal, left)]
    texts = [value.text if value is not None else "–" for value in (*rms, *most)]
    return Section(
        "Residuals before and after",
        [
            f"Against an ideal bench without errors the readings are off by {texts[0]} g (root mean square), at most "
            f"{texts[2]} g; against the calibrated one by {texts[1]} g, at most {texts[3]} g. The picture shows the "
            "latter, in units of σ."
        ],
        residuals(
            np.degrees(here.positions.alpha),
            np.degrees(here.positions.beta),
            left / here.bound.reshape(-1, 3),
            None,
            proved(result, numbers),
        ),
        "Residuals over the angles of the outer and the inner axis; the band is the noise bound.",
    )
