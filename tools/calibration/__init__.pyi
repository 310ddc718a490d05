from .calibration import calibrate as calibrate
from .calibration import fit_record as fit_record
from .correction import Application as Application
from .correction import apply_calibration as apply_calibration
from .correction import write_parameter_set as write_parameter_set
from .gyros import Bench as Bench
from .gyros import calibrate_whole as calibrate_whole
from .result import Calibration as Calibration
