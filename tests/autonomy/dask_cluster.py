"""A real cluster of Dask's own processes on loopback."""

import json
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

WAIT_S = 60.0


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
        end_s = time.monotonic() + WAIT_S
        while not file.exists() or not file.read_text():
            assert time.monotonic() < end_s
            time.sleep(0.05)
        yield process, json.loads(file.read_text())["address"]


def worker(address: str, folder: Path):
    options = ("--nthreads", "1", "--no-dashboard", "--local-directory", str(folder))
    return dask_process("dask_worker", address, "--host", "127.0.0.1", "--no-nanny", *options)
