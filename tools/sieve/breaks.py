"""A break: something of bench or block changes once, between two rows."""

from ..evidence.evidence import Evidence
from .simple import Simple


def breaks(evidence: Evidence) -> tuple[Simple, ...]:
    """The smallest breaks with which the model stands."""
    return ()
