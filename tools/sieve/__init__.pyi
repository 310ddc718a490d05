from .beside import rows_beside_effects as rows_beside_effects
from .faults import simple_faults as simple_faults
from .joint import LEAST_OF_TWO as LEAST_OF_TWO
from .joint import joint_faults as joint_faults
from .joint import tells_two_things as tells_two_things
from .sigma import too_small_bounds as too_small_bounds
from .simple import Simple as Simple
from .simple import calibration_of as calibration_of
