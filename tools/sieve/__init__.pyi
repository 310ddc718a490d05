from .faults import simple_faults as simple_faults
from .sigma import too_small_bounds as too_small_bounds
from .simple import Simple as Simple
from .simple import calibration_of as calibration_of
