from .calibration import calibrate_by_hand as calibrate_by_hand
from .pooled import calibrate_runs_by_hand as calibrate_runs_by_hand
from .run import HandRecord as HandRecord
from .run import HandRequest as HandRequest
from .run import parted_at_cuts as parted_at_cuts
from .run import run_of as run_of
