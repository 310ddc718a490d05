"""A noise bound that is too small."""

from ..evidence.evidence import Evidence
from .simple import Simple


def too_small_bounds(evidence: Evidence) -> tuple[Simple, ...]:
    """The least noise bound with which the model stands, where it is the simplest explanation."""
    return ()
