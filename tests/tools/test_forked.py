"""A forked process works, or reports at once that its parent had used polars' threads; it never waits for ever."""

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import multiprocessing, sys
import polars as pl
import trihedron as th

def in_child(queue):
    try:
        th.inspect(sys.argv[1])
    except Exception as error:
        queue.put(str(error))
    else:
        queue.put("done")

if __name__ == "__main__":
    first, method = sys.argv[2:]
    if first == "use":
        frame = pl.DataFrame({"a": range(100_000), "b": range(100_000)})
        frame.lazy().group_by("a").agg(pl.col("b").sum()).collect()
        th.inspect(sys.argv[1])
    elif first == "look":
        th.inspect(sys.argv[1])
    context = multiprocessing.get_context(method)
    queue = context.Queue()
    process = context.Process(target=in_child, args=(queue,))
    process.start()
    print(queue.get(timeout=60))
    process.join()
"""


@pytest.mark.first(1)
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are known by name on Linux alone")
@pytest.mark.parametrize(
    ("first", "method", "message"),
    [
        ("use", "fork", "polars has lost its threads"),
        ("nothing", "fork", "done"),
        ("look", "fork", "done|polars has lost its threads"),
        ("use", "spawn", "done"),
        ("use", "forkserver", "done"),
    ],
)
def test_a_process_works_or_says_why_not(first: str, method: str, message: str, tmp_path: Path) -> None:
    record = tmp_path / "strapdown.csv"
    lines = ["time_s,w1_radps,w2_radps,w3_radps,f1_mps2,f2_mps2,f3_mps2"]
    lines += [f"{0.01 * k:.2f},0.0,0.0,{1e-6 * (k % 7)},0.0,0.0,{9.81 + 1e-4 * (k % 5)}" for k in range(3000)]
    record.write_text("\n".join(lines) + "\n")
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    command = [sys.executable, str(program), str(record), first, method]
    process = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert any(words in process.stdout for words in message.split("|")), process.stdout + process.stderr
