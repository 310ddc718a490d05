"""`python -m trihedron.tools.cli`."""

import sys

from .app import program

sys.exit(program())
