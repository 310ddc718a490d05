"""Print the lowest versions in pyproject.toml as requirements: `name==version`, a line for each dependency."""

import re
import sys
import tomllib
from pathlib import Path


def lowest(project: str) -> list[str]:
    """Return each dependency of a pyproject.toml at its lowest version."""
    named = tomllib.loads(project)["project"]["dependencies"]
    matches = {text: re.fullmatch(r"([\w.-]+)>=([\w.]+)", text) for text in named}
    if unknown := [text for text, match in matches.items() if match is None]:
        raise SystemExit(f"pyproject.toml: {unknown[0]!r} names no least version as 'name>=version'")
    return [f"{match[1]}=={match[2]}" for match in matches.values() if match]


if __name__ == "__main__":
    sys.stdout.write("\n".join(lowest(Path("pyproject.toml").read_text(encoding="utf-8"))) + "\n")
