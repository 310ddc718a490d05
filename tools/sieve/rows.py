"""Rows that do not belong to a record: the fewest whose removal lets the model stand."""

from ..evidence.evidence import Evidence
from .simple import Simple


def wrong_rows(evidence: Evidence) -> tuple[Simple, ...]:
    """The smallest sets of rows without which the model stands."""
    return ()
