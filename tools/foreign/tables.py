"""The table of units, words, patterns and messages by which foreign files are understood, as data."""

import tomllib
from pathlib import Path
from typing import Any

TABLES: dict[str, Any] = tomllib.loads(Path(__file__).with_name("tables.toml").read_text(encoding="utf-8"))
"""The tables by their names."""
