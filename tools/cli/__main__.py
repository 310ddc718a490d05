"""`python -m trihedron.tools.cli`."""

import sys

from .app import main

sys.exit(main())
