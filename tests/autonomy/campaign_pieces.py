"""Pieces of campaigns, in a module of their own, for each machine of a cluster imports it."""

import os
import tempfile
import time
from pathlib import Path

import numpy as np

from autonomy.arrays import FloatArray
from tests.autonomy.dask_cluster import wait_until


def norm(shared: FloatArray, item: float) -> float:
    """A piece of work that takes an array of everybody's and a number of its own."""
    return float(np.linalg.norm(shared * item))


def slow(shared: float, item: int) -> int:
    time.sleep(shared)
    return item


def faulty(shared: int, item: int) -> int:
    if item == shared:
        raise ArithmeticError(f"piece {item}")
    return item


def counted_fault(shared: Path, item: int) -> None:
    """Raise, after leaving a file for each time that it was begun."""
    tempfile.mkstemp(dir=shared)
    raise ArithmeticError(f"piece {item}")


def process_of(_shared: None, _item: int) -> int:
    return os.getpid()


def met_process_of(shared: Path, _item: int) -> int:
    """Return the process, once two are at work at the same time."""
    (shared / str(os.getpid())).touch()
    wait_until(lambda: len(list(shared.iterdir())) > 1)
    return os.getpid()


def noted(shared: Path, item: int) -> int:
    """Leave a file that says that it is done."""
    (shared / f"{item}.done").touch()
    return item
