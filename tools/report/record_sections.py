"""What was measured, and what the results rest on: record, options, versions, seeds."""

import sys
from collections.abc import Mapping
from importlib import metadata

import numpy as np

from ...fmus import version
from ..calibration import Calibration
from ..records import PositionRecord
from .cells import typeset
from .direction_pictures import next_directions
from .page import Section
from .rounding import minus

LIBRARIES = ("numpy", "scipy", "highspy", "fmpy")


def measured_section(record: PositionRecord, result: Calibration, *, rests: int | None = None) -> Section:
    """The record in words, and where on the sphere it has measured."""
    seconds = float(np.ptp(record.time_s))
    lasted = f"{seconds:.0f} seconds" if seconds < 120.0 else f"{seconds / 60.0:.0f} minutes"
    said = [
        f"{len(record)} positions of the table within {lasted}, three accelerometers at each; "
        f"{result.measurements} readings are used."
    ]
    if rests is not None:
        said.append(
            f"They are averages of the rests that were found in a time series: {rests}, of which {len(record)}."
        )
    known = []
    if record.temperature is not None:
        low, high = float(record.temperature.min()), float(record.temperature.max())
        known.append(f"temperature {low:.1f} to {high:.1f} °C" if high - low >= 0.05 else f"temperature {low:.1f} °C")
    if record.approach_alpha is not None:
        known.append("the senses in which the positions were approached")
    if record.mounting is not None:
        known.append(f"the mountings {', '.join(dict.fromkeys(record.mounting))}")
    if known:
        said.append(f"Known besides: {'; '.join(known)}.")
    said.append(f"Errors of averaged readings are taken to be within σ = {result.noise_bound:.3g} g ({basis(result)}).")
    said += [f"Warning: {warning}." for warning in result.warnings]
    return Section(
        "What was measured",
        said,
        next_directions(record.alpha, record.beta, [], []),
        "The vertical as the inner frame sees it at each position; equal areas are equal solid angles.",
    )


def basis(result: Calibration) -> str:
    """On what the noise bound rests, in words."""
    return "as given" if result.noise_bound_basis == "given" else result.noise_bound_basis


def key_figures(result: Calibration) -> dict[str, object]:
    """What stands below the verdict."""
    return {
        "positions": result.positions,
        "readings": result.measurements,
        "noise bound σ": f"{result.noise_bound:.3g} g",
        "least largest residual": f"{result.radius:.3g} σ",
    }


def provenance(result: Calibration, more: Mapping[str, object] | None = None) -> dict[str, object]:
    """What a result rests on: record, options, versions; the same inputs give the same page."""
    p = result.linearised.parametrisation
    given: dict[str, object] = {}
    if result.provenance is not None:
        given["record"] = result.provenance.record
        if result.provenance.sha256:
            given["record, SHA-256"] = result.provenance.sha256
    given["noise bound"] = typeset(f"{result.noise_bound:.6g} g, {basis(result)}")
    given["gravity"] = f"{result.gravity:.8g} m/s²"
    given["model"] = f"{result.baseline} scale factors, convention {result.convention}"
    if result.provenance is not None:
        u, v = result.provenance.bounds
        given["bounds of (1.7)"] = f"u = {u:g}, v = {v:g}"
    for name, matrix in zip(p.mountings, p.matrices, strict=True):
        rows = "; ".join(" ".join(f"{value:.6g}" for value in row) for row in np.asarray(matrix))
        given[f"mounting {name}"] = minus(rows)
    for prior in result.priors:
        given[f"known beforehand, {prior.expression}"] = f"at most {prior.limit:g}"
    return given | dict(more or {}) | versions()


def versions() -> dict[str, object]:
    """Of the program and of what it computes with."""
    python = ".".join(str(part) for part in sys.version_info[:3])
    libraries = ", ".join(f"{name} {metadata.version(name)}" for name in LIBRARIES)
    return {"trihedron": version(), "computed with": f"Python {python}, {libraries}"}
