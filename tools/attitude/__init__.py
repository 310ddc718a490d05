"""The attitude of a measured record: its gyros through the attitude computer's FMU, against the true attitude."""

from .comparison import compare_algorithms
from .data_folder import WHERE_TO_GET, find_record
from .error_split import split_error
from .measured import attitude_of_record
from .run import AttitudeRun
from .sampling import rate_at_rest

__all__ = [
    "WHERE_TO_GET",
    "AttitudeRun",
    "attitude_of_record",
    "compare_algorithms",
    "find_record",
    "rate_at_rest",
    "split_error",
]
