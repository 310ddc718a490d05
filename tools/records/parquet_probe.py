"""Run as a script: exit 0 when polars can read the Parquet file on standard input, else print why and exit 1.

It stands alone: corrupt files make polars' native code write to standard error, or end the process.
"""

import io
import sys


def main() -> int:
    """The exit status."""
    import polars as pl

    try:
        pl.read_parquet(io.BytesIO(sys.stdin.buffer.read()))
    except (Exception, pl.exceptions.PanicException) as error:
        print((str(error).strip() or type(error).__name__).splitlines()[0])
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
