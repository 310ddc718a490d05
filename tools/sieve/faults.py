"""All simple faults with which the model of a record stands."""

from ..evidence.evidence import Evidence
from .breaks import breaks
from .rows import wrong_rows
from .sigma import too_small_bounds
from .simple import Simple
from .stretch import wrong_stretches


def simple_faults(evidence: Evidence) -> tuple[Simple, ...]:
    """The simple faults of a record whose model is falsified: rows, stretches, breaks, a noise bound too small."""
    rows = wrong_rows(evidence) or wrong_stretches(evidence)
    return (*rows, *breaks(evidence), *too_small_bounds(evidence))
