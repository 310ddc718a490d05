"""Several records of one instrument calibrated in one programme: what it has in all of them, and each record's own."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from pydantic import Field

from ...fmus.parameters import JOINT_CALIBRATION
from ..calibration.result import ReadingError
from ..calibration.targets import corners, error_weights
from ..evidence.joint import join
from ..result import Result, Told
from .cause import Number, SizedParameter, centred, parameters_of
from .several import members_of


class OfRecord(Result):
    """What is told of one record: its σ, its mountings, and what its accelerometers may be off by at the corners."""

    noise_bound: Number
    mountings: dict[str, list[list[Number]]]
    reading_errors: list[ReadingError] = Field(default=[])


class JointParameter(SizedParameter):
    """A parameter of the instrument, or of one `record`, with what all records together leave possible of it.

    Where nothing bounds it there is no estimate.
    """

    estimate: Number | None
    record: str | None


class JointCalibration(Told):
    """Records of one instrument, calibrated together.

    `verdict`: "consistent"; "falsified": no such values do for all, which `trihedron diagnose` of them explains;
    "insufficient": what `missing` names stays open. `radius` is the least largest error over its bound; estimates are
    one possible point, none where the records are falsified. `of_records` has by label what is of each.
    """

    schema_: Literal["trihedron.joint-calibration/1"] = Field(default=JOINT_CALIBRATION, alias="schema")
    verdict: Literal["consistent", "falsified", "insufficient"]
    records: tuple[str, ...]
    sha256: tuple[str, ...]
    radius: Number
    gravity: Number = Field(alias="gravity_mps2")
    convention: Literal["A1"] = "A1"
    baseline: Literal["asymmetric", "symmetric"]
    of_records: Mapping[str, OfRecord]
    parameters: tuple[JointParameter, ...] = ()
    missing: tuple[str, ...] = ()


def calibrated_together(
    members: Mapping[str, Any],
    *,
    shared: Sequence[str] = (),
    own: Sequence[str] = (),
    sha256: Sequence[str] = (),
) -> JointCalibration:
    """The calibration of a table's records, by the labels of their evidence.

    `shared`, `own` are as for `join`, InputErrors as for `members_of`.
    """
    joint = join(members_of(members, shared, own), shared, own)
    first = next(iter(members.values())).calibration
    of_records = {
        label: OfRecord(noise_bound=one.calibration.noise_bound, mountings=one.calibration.mountings)
        for label, one in members.items()
    }
    told: dict[str, Any] = {"records": tuple(members), "sha256": tuple(sha256), "radius": joint.baseline_radius}
    told |= {"gravity_mps2": first.gravity, "baseline": first.baseline, "of_records": of_records}
    if joint.falsified:
        return JointCalibration(verdict="falsified", **told)
    fit, missing = centred(joint, joint.baseline), joint.missing().get("missing", ())
    found = []
    for p in parameters_of(joint, fit):
        symbol, _, record = p.name.partition(" in ")
        stated = None if None in (p.low, p.high) else p.estimate
        found.append(JointParameter(**{**dict(p), "name": symbol, "estimate": stated}, record=record or None))
    found.sort(key=lambda one: one.record is not None)
    if not missing:
        possible = fit.possible(joint.room(fit), None, joint.most_rows).among(np.arange(len(fit.central)))
        for (label, one), chosen in zip(members.items(), joint.chosen, strict=True):
            weights = error_weights(one.here.parametrisation) @ chosen
            errors = [
                ReadingError(
                    accelerometer=p,
                    input=list(n),
                    low=w @ fit.central - possible(-w),
                    high=w @ fit.central + possible(w),
                )
                for (p, n), w in zip(corners(), weights, strict=True)
            ]
            of_records[label] = of_records[label].model_copy(update={"reading_errors": errors})
    verdict = "insufficient" if missing else "consistent"
    return JointCalibration(verdict=verdict, parameters=tuple(found), missing=missing, **told)
