"""All simple faults that make the model of a record fit."""

from ..evidence.evidence import Evidence
from .breaks import breaks
from .rows import wrong_rows, wrong_stretches
from .series import wrong_pieces
from .sigma import too_small_bounds
from .simple import Simple


def simple_faults(evidence: Evidence) -> tuple[Simple, ...]:
    """Return the simple faults of a falsified record: rows, stretches, pieces of a series, breaks, σ too small."""
    rows = wrong_rows(evidence) or wrong_stretches(evidence) or wrong_pieces(evidence)
    return (*rows, *breaks(evidence), *too_small_bounds(evidence))
