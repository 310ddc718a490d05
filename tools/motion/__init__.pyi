from .attitude import AttitudeRun as AttitudeRun
from .attitude import attitude_of_record as attitude_of_record
from .compare import compare_algorithms as compare_algorithms
from .inspect import Inspection as Inspection
from .inspect import inspect_record as inspect_record
