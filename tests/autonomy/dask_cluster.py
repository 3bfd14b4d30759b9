"""A real cluster of Dask's own processes on loopback."""

import json
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path

WAIT_S = 120.0


def wait_until(is_so: Callable[[], bool]) -> None:
    end_s = time.monotonic() + WAIT_S
    while not is_so():
        assert time.monotonic() < end_s
        time.sleep(0.02)


@contextmanager
def dask_process(module: str, *arguments: str):
    """One of Dask's own processes; it ends with the block."""
    command = [sys.executable, "-m", f"distributed.cli.{module}", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextmanager
def scheduler(folder: Path):
    file = folder / "scheduler.json"
    options = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    with dask_process("dask_scheduler", *options, "--scheduler-file", str(file)) as process:
        wait_until(lambda: file.exists() and file.read_text().rstrip().endswith("}"))
        yield process, json.loads(file.read_text())["address"]


def worker(address: str, folder: Path):
    options = ("--nthreads", "1", "--no-dashboard", "--local-directory", str(folder))
    return dask_process("dask_worker", address, "--host", "127.0.0.1", "--no-nanny", *options)
