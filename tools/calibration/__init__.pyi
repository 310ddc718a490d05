from .correction import Application as Application
from .correction import apply_calibration as apply_calibration
from .correction import write_parameter_set as write_parameter_set
from .procedure import calibrate as calibrate
from .procedure import fit_record as fit_record
from .result import Calibration as Calibration
