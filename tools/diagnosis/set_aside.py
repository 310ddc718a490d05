"""Faults of single records among several: set aside before the records are judged together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..evidence.bench import Bench
from ..evidence.evidence import Evidence
from ..evidence.joint import join
from ..sieve import Removal, fault_of_row
from .procedure import diagnosed
from .result import Diagnosis

READINGS = 3
"""Readings of a position."""
SECOND_ORDER = 0.05
"""Largest error of the linear model of all records, in bounds."""
ROW = 4
"""Numbers of a wrong row without a known change."""


@dataclass(frozen=True, eq=False)
class SetAside:
    """Diagnoses of records by their labels, those with a fault without it, and the sentences on the faults."""

    diagnoses: Mapping[str, Diagnosis]
    sentences: Mapping[str, str]

    @staticmethod
    def of(alone: Mapping[str, Diagnosis]) -> "SetAside":
        """Set aside the wrong rows, and the noise bounds that are too small, that records show by themselves."""
        diagnoses, sentences = {}, {}
        for label, diagnosis in alone.items():
            diagnoses[label] = diagnosis
            if diagnosis.remaining is not None:
                diagnoses[label] = diagnosed(diagnosis.remaining, rerun=False)
                sentences[label] = diagnosis.explanations[0].sentence
        return SetAside(diagnoses, sentences)

    def beside(
        self, shared: Sequence[str], own: Sequence[str], left_out: Mapping[str, str | None]
    ) -> "SetAside | None":
        """Set aside, too, the one row without which all position records fit together; None if there is none.

        `shared`, `own` are as for `join`; `left_out` has the labels of records that are not used.
        """
        members = {}
        for label, diagnosis in self.diagnoses.items():
            is_open = diagnosis.verdict in ("consistent", "unexplained") or bool(diagnosis.findings)
            if is_open and isinstance(diagnosis.evidence.model, Bench) and not left_out.get(label):
                members[label] = diagnosis.evidence
        if len(members) < 2:
            return None
        joint = join(members, shared, own)
        rows = wrong_rows_of(joint) if joint.model.falsified else []
        if len(rows) != 1:
            return None
        starts = joint.model.starts // READINGS
        k = int(np.searchsorted(starts, rows[0], side="right")) - 1
        label = joint.model.labels[k]
        fault = fault_of_row(members[label], rows[0] - int(starts[k]))
        if fault is None or label in self.sentences:
            return None
        diagnoses = {**self.diagnoses, label: diagnosed(fault.evidence, rerun=False)}
        return SetAside(diagnoses, {**self.sentences, label: fault.sentence})


def wrong_rows_of(joint: Evidence) -> list[int]:
    """Return the rows of a joint (from 0, all records one below the other) each of whose removal makes the rest fit."""
    rows = joint.rows
    target = rows.residual / rows.bound
    excess = np.abs(target).reshape(-1, READINGS).max(axis=1)
    belongs = np.repeat(np.eye(len(excess), dtype=bool), READINGS, axis=0)
    limit = joint.model.limit + SECOND_ORDER
    standing = Removal(rows.nominal / rows.bound[:, None], target, belongs, excess, limit).smallest(1)
    return [row for parts in standing for row in parts]
