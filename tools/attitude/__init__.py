"""The attitude of a measured record: its gyros through the attitude computer's FMU, against the true attitude."""

from trihedron.attitude.comparison import compare_algorithms
from trihedron.attitude.data_folder import WHERE_TO_GET, find_record
from trihedron.attitude.error_split import split_error
from trihedron.attitude.measured import attitude_of_record
from trihedron.attitude.run import AttitudeRun
from trihedron.attitude.sampling import rate_at_rest

__all__ = [
    "WHERE_TO_GET",
    "AttitudeRun",
    "attitude_of_record",
    "compare_algorithms",
    "find_record",
    "rate_at_rest",
    "split_error",
]
