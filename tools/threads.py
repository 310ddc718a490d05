"""One thread for the linear algebra: matrices are small here, and threads would only wait for each other.

Imported by the command line before numpy; a user's own setting in the environment is kept.
"""

import os

for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
