from .attitude import EXACT as EXACT
from .attitude import paper_motion as paper_motion
from .reproduction import check_published_calibration as check_published_calibration
from .reproduction import reproduce_attitude as reproduce_attitude
from .reproduction import word_length_errors as word_length_errors
