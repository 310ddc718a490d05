from .faults import simple_faults as simple_faults
from .simple import Simple as Simple
from .simple import calibration_of as calibration_of
