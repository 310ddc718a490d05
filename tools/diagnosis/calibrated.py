"""Several records of one instrument calibrated in one programme."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..calibrated import Calibration, OfRecord, Open, Parameter, Provenance, ReadingError, Sigma, Verdict
from ..calibration.targets import NAMES, corners, error_weights
from ..evidence.fit import Fit
from ..evidence.joint import Joint, join
from .cause import centred, parameters_of
from .several import members_of

OF_EACH = Sigma.of(None, "each record has its own")


def calibrated_together(
    members: Mapping[str, Any],
    *,
    shared: Sequence[str] = (),
    own: Sequence[str] = (),
    sha256: Sequence[str],
) -> Calibration:
    """Return the calibration of a table's records, by the labels of their evidence.

    `shared`, `own` are as for `join`, InputErrors as for `members_of`. A falsified one has no parameters: no values fit
    all records, and `trihedron diagnose` says why.
    """
    joint = join(members_of(members, shared, own), shared, own)
    missing: tuple[str, ...] = ()
    parameters: dict[str, list[Parameter]] = {label: [] for label in ["", *members]}
    errors: dict[str, list[ReadingError]] = {label: [] for label in members}
    verdict: Verdict = "falsified"
    if not joint.falsified:
        fit, missing = centred(joint, joint.baseline), joint.missing().get("missing", ())
        for sized in parameters_of(joint, fit):
            symbol, _, record = sized.name.partition(" in ")
            bounded, estimate = sized.low is not None and sized.high is not None, None
            if bounded:
                estimate = float(sized.estimate)
            target, at, mounting = symbol.partition("@")
            parameters[record].append(
                Parameter(
                    symbol=symbol,
                    name=NAMES[target][0] + at + mounting,
                    unit=sized.unit,
                    determined=bounded,
                    estimate=estimate,
                    low=sized.low,
                    high=sized.high,
                )
            )
        verdict = "insufficient" if missing else "consistent"
    if verdict == "consistent":
        errors = dict(zip(members, _reading_errors(joint, members, fit), strict=True))
    of_record = {
        label: OfRecord(
            sigma=evidence.calibration.sigma,
            mountings=evidence.calibration.mountings,
            parameters=parameters[label],
            reading_errors=errors[label],
            provenance=Provenance(record=label, record_sha256=digest),
        )
        for (label, evidence), digest in zip(members.items(), sha256, strict=True)
    }
    first = next(iter(members.values())).calibration
    return Calibration(
        verdict=verdict,
        sigma=OF_EACH,
        radius=joint.baseline_radius,
        gravity_mps2=first.gravity,
        convention="A1",
        baseline=first.baseline,
        estimator=None if verdict == "falsified" else "analytic centre",
        parameters=parameters[""],
        open=[Open(parameters=[name]) for name in missing],
        of_record=of_record,
    )


def _reading_errors(joint: Joint, members: Mapping[str, Any], fit: Fit) -> list[list[ReadingError]]:
    """Return what the accelerometers may be off by at the corners of the input, for each record."""
    possible = fit.possible(joint.room(fit), None, joint.most_rows).among(np.arange(len(fit.central)))
    errors = []
    for member, chosen in zip(members.values(), joint.chosen, strict=True):
        weights = error_weights(member.here.parametrisation) @ chosen
        of_member = []
        for (accelerometer, n), w in zip(corners(), weights, strict=True):
            middle = float(w @ fit.central)
            of_member.append(ReadingError.of(accelerometer, n, middle - possible(-w), middle + possible(w)))
        errors.append(of_member)
    return errors
