"""A stretch of rows that does not belong to the rest."""

from ..evidence.evidence import Evidence
from .simple import Simple


def wrong_stretches(evidence: Evidence) -> tuple[Simple, ...]:
    """The shortest stretches without which the model stands."""
    return ()
