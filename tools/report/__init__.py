"""Pictures and the page of results: one HTML file that opens anywhere, without network and without script."""

from .calibration_pictures import residuals
from .diagnosis_pictures import candidates, held_out
from .page import Section, Table, render_page, write_page
from .time_pictures import attitude_error, bench_tour

__all__ = [
    "Section",
    "Table",
    "attitude_error",
    "bench_tour",
    "candidates",
    "held_out",
    "render_page",
    "residuals",
    "write_page",
]
