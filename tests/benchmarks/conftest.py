"""Costs that are measured become rows of the tables in docs/figures.md."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from costs import write_row


@pytest.fixture
def cost_row(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Return a function that writes a row, as `write_row`; without `--costs` it writes nothing."""
    docs: Path | None = request.config.getoption("costs")
    return (lambda *_: None) if docs is None else partial(write_row, docs)
