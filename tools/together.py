"""What `import trihedron as th` does with several records of one instrument: as `measured`, documented once."""

from collections.abc import Sequence
from typing import Any

from . import calibration as calibrations
from . import diagnosis, own_effects, records
from .errors import InputError
from .options import (
    Baseline,
    Bounds,
    Channels,
    EffectsFrom,
    Extend,
    Gravity,
    Mounting,
    NoiseBound,
    Own,
    Progress,
    Rates,
    RecordBaseline,
    ReferenceBound,
    Shared,
)


def calibrate_together(
    first: "records.Source",
    /,
    *others: "records.Source",
    noise_bound: NoiseBound = None,
    gravity: Gravity = 9.80665,
    baseline: Baseline = "asymmetric",
    bounds: Bounds = (3e-3, 1e-2),
    mounting: Mounting = "identity",
    channels: Channels = (),
    shared: Shared = (),
    own: Own = (),
) -> "calibrations.Calibration":
    """Calibrate several records of one instrument in one programme: its scale factors and misalignments have one value.

    Parameters
    ----------
    first, others : path, table in memory or record
        Position records or raw records, two at least.

    Raises
    ------
    InputError
        whatever cannot be done, in one line
    """
    runs = _several((first, *others), (records.PositionRecord,), channels)
    for run in runs.values():
        if noise_bound is None and not records.tells_noise(run):
            raise InputError(f"{run.path}: does not tell its noise bound: give --noise-bound")
    evidence, digests = {}, []
    for label, run in runs.items():
        evidence[label] = diagnosis.evidence_of(
            run, noise_bound=noise_bound, gravity=gravity, baseline=baseline, bounds=bounds, mounting=mounting
        )
        digests.append(run.sha256)
    return diagnosis.calibrated_together(evidence, shared=shared, own=own, sha256=digests)


def diagnose_together(
    first: "records.Source",
    /,
    *others: "records.Source",
    noise_bound: NoiseBound = None,
    gravity: Gravity = 9.80665,
    baseline: RecordBaseline = None,
    bounds: Bounds = (3e-3, 1e-2),
    mounting: Mounting = "identity",
    channels: Channels = (),
    rates: Rates = "instantaneous",
    reference_bound: ReferenceBound = None,
    effects_from: EffectsFrom = None,
    extend: Extend = False,
    shared: Shared = (),
    own: Own = (),
    progress: Progress = False,
) -> "diagnosis.Diagnosis":
    """Say what several records of one instrument have in common, and what is of one run alone.

    Each is diagnosed by itself; then all together, with one value for each parameter of the instrument; then the
    smallest set of effects, of all records or of one, and of parameters that differ in one, with which all stand.
    Options are the same for all records; one that has a meaning for one kind only is for those of that kind.

    Parameters
    ----------
    first, others : path, table in memory or record
        Records of one instrument, of positions (or raw), strapdown, or some of both, two at least. Files are called by
        their names, others by their numbers.

    Raises
    ------
    InputError
        whatever cannot be done, in one line

    Examples
    --------
    >>> import trihedron as th
    >>> th.diagnose_together("monday.csv", "tuesday.csv", "friday.csv", noise_bound=1e-5)  # doctest: +SKIP
    """
    runs = _several((first, *others), (records.PositionRecord, records.StrapdownRecord), channels)
    options = {"noise_bound": noise_bound, "gravity": gravity, "baseline": baseline, "bounds": bounds}
    options |= {"mounting": mounting, "rates": rates, "reference_bound": reference_bound}
    with own_effects.with_effects_of(effects_from):
        single = {}
        for label, run in runs.items():
            single[label] = diagnosis.evidence_of(run, **diagnosis.evidence_options(run, among=runs, **options))
        evidence = diagnosis.members_of(single, shared, own)
        alone, unsure, digests = {}, {}, {}
        for label, run in runs.items():
            alone[label] = diagnosis.diagnose(run, evidence=evidence[label], extend=extend, progress=progress)
            digests[label] = run.sha256
            tells = not isinstance(run, records.PositionRecord) or records.tells_noise(run)
            if noise_bound is None and not tells:
                unsure[label] = (
                    "its noise bound is the scatter within rests, which falsifies nothing: give --noise-bound"
                )
        return diagnosis.diagnosed_together(
            alone, shared=shared, own=own, left_out=unsure, sha256=digests, progress=progress
        )


def _several(sources: Sequence["records.Source"], kinds: tuple[type, ...], channels: Sequence[str]) -> dict[str, Any]:
    """Several records by what they are called; an InputError for fewer than two, or for one that is given twice."""
    if len(sources) < 2:
        raise InputError("several records are needed, two at least")
    runs = [records.read_record(source, *kinds, channels=channels) for source in sources]
    digests = set()
    for run in runs:
        if run.sha256 and run.sha256 in digests:
            raise InputError(f"{run.path}: is given twice")
        digests.add(run.sha256)
    return dict(zip(diagnosis.labels_of([run.path for run in runs]), runs, strict=True))
