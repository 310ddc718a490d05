"""Parquet files of others: another process looks at one first; a corrupt one may end the process that reads it."""

import subprocess
import sys

MAGIC = b"PAR1"
"""What a Parquet file begins with."""
MOST_NUMBERS = 200_000_000
"""Rows times columns of a file that is read, compressed as it may be: 1.6 GB in memory."""

_PROBE = f"""
import io, sys
import polars as pl
data = sys.stdin.buffer.read()
try:
    width = len(pl.read_parquet_schema(io.BytesIO(data)))
    rows = pl.scan_parquet(io.BytesIO(data)).select(pl.len()).collect().item()
    if rows * width > {MOST_NUMBERS}:
        print(f"has {{rows}} rows of {{width}} columns; at most {MOST_NUMBERS} numbers are read")
        sys.exit(1)
    pl.read_parquet(io.BytesIO(data))
except (Exception, pl.exceptions.PanicException) as error:
    reason = (str(error).strip() or type(error).__name__).splitlines()[0]
    print(f"is not a readable Parquet file ({{reason[:120]}})")
    sys.exit(1)
"""


def fault_of_parquet(content: bytes) -> str | None:
    """Why the bytes of a Parquet file cannot be read, or are too many numbers to read; None where they can."""
    probe = subprocess.run([sys.executable, "-I", "-c", _PROBE], input=content, capture_output=True, check=False)
    if probe.returncode == 0:
        return None
    message = probe.stdout.decode("utf-8", "replace").strip()
    return message or "is not a readable Parquet file (it is corrupt)"
