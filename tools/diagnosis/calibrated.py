"""Several records of one instrument calibrated in one programme: what it has in all of them, and each record's own."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from pydantic import Field

from ..evidence.evidence import Evidence
from ..evidence.joint import join
from ..result import Told, finite_or_none
from .cause import Number, SizedParameter
from .procedure import centred
from .several import check_asked

JOINT = "trihedron.joint-calibration/1"


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
    one possible point, none where the records are falsified.
    """

    schema_: Literal["trihedron.joint-calibration/1"] = Field(default=JOINT, alias="schema")
    verdict: Literal["consistent", "falsified", "insufficient"]
    records: tuple[str, ...]
    sha256: tuple[str, ...]
    radius: Number
    parameters: tuple[JointParameter, ...] = ()
    missing: tuple[str, ...] = ()


def calibrated_together(
    members: Mapping[str, Evidence],
    *,
    shared: Sequence[str] = (),
    own: Sequence[str] = (),
    sha256: Sequence[str] = (),
) -> JointCalibration:
    """The calibration of records, by their labels; `shared`, `own` as for `join`, InputErrors as for `check_asked`."""
    check_asked(members, shared, own)
    joint = join(members, shared, own)
    told: dict[str, Any] = {"records": tuple(members), "sha256": tuple(sha256), "radius": joint.baseline_radius}
    if joint.falsified:
        return JointCalibration(verdict="falsified", **told)
    fit, missing = centred(joint, joint.baseline), joint.missing().get("missing", ())
    found = []
    for (name, unit), value, (low, high) in zip(
        joint.names, fit.estimate, fit.ends(joint.room(fit), joint.most_rows), strict=True
    ):
        symbol, _, record = name.partition(" in ")
        ends = {"low": finite_or_none(low), "high": finite_or_none(high)}
        stated = None if None in ends.values() else value
        found.append(JointParameter(name=symbol, unit=unit, record=record or None, estimate=stated, **ends))
    found.sort(key=lambda one: one.record is not None)
    verdict = "insufficient" if missing else "consistent"
    return JointCalibration(verdict=verdict, parameters=tuple(found), missing=missing, **told)
