"""Options of a diagnosis, and the evidence that a record gives with them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from ..calibration.gyros import Bench as Place
from ..errors import InputError
from ..evidence.bench import bench_evidence
from ..evidence.bench_in_motion import whole_evidence
from ..evidence.carried_record import carried_evidence
from ..evidence.evidence import Evidence
from ..records import PositionRecord, StrapdownRecord


def evidence_of(record: PositionRecord | StrapdownRecord, *, bench: Place | None = None, **options: Any) -> Evidence:
    """The evidence of a record: options of positions as for `bench_evidence`, else as for `carried_evidence`.

    `bench` says where a bench record was measured: then its gyros are held against the table, too.
    """
    if isinstance(record, StrapdownRecord):
        return carried_evidence(record, **options)
    return bench_evidence(record, **options) if bench is None else whole_evidence(record, bench, **options)


def evidence_options(
    run: Any,
    *,
    among: Mapping[str, Any] | None = None,
    noise_bound: float | None = None,
    gravity: float = 9.80665,
    baseline: str | None = None,
    bounds: tuple[float, float] = (3e-3, 1e-2),
    mounting: str | Mapping[str, ArrayLike] = "identity",
    rates: str = "instantaneous",
    reference_bound: float | None = None,
    bench: Place | None = None,
) -> dict[str, Any]:
    """Options of a record's evidence, as of `diagnose`; an InputError for one that its kind does not have.

    `among` are the records with which it is diagnosed: of two kinds each has the options that are its own.
    """
    carried = isinstance(run, StrapdownRecord)
    if any(isinstance(other, StrapdownRecord) != carried for other in (among or {}).values()):
        if carried:
            noise_bound, bounds, mounting = None, (3e-3, 1e-2), "identity"
        else:
            rates, reference_bound = "instantaneous", None
        baseline = baseline if (baseline in ("calibrated", "nominal")) == carried else None
    if carried:
        if noise_bound is not None or bounds != (3e-3, 1e-2) or mounting != "identity":
            raise InputError(f"{run.path}: of a strapdown record noise_bound, bounds and mounting have no meaning")
        if bench is not None:
            raise InputError(f"--latitude-deg: is of a bench record; {run.path} is a strapdown record")
        return {"gravity": gravity, "baseline": baseline, "rates": rates, "reference_bound": reference_bound}
    if rates != "instantaneous" and bench is None:
        raise InputError(f"--rates {rates}: is of a strapdown record; a record of a table has no rates")
    if reference_bound is not None:
        raise InputError(
            f"--reference-bound {reference_bound:g}: is of a strapdown record; a record of a table has no true attitude"
        )
    own = {"noise_bound": noise_bound, "bounds": bounds, "mounting": mounting}
    own |= {} if bench is None else {"bench": replace(bench, rates=rates)}
    return {"gravity": gravity, "baseline": baseline or "asymmetric", **own}
