"""`python -m trihedron.tools.cli`."""

import sys

from . import program

sys.exit(program())
