from .attitude import EXACT as EXACT
from .attitude import paper_motion as paper_motion
from .attitude import reproduce_attitude as reproduce_attitude
from .calibration import check_published_calibration as check_published_calibration
from .word_length import word_length_errors as word_length_errors
