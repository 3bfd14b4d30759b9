"""How fast this machine is just now, beside the machine on which the bars were set.

A bar in seconds, or per second, says as much of the machine as of the product. Such a bar is
therefore a ratio to a yardstick that is measured in the same run, right before and right after the
measured thing: one Runge-Kutta step of ``vehicle.c`` for what is compiled, a loop of plain Python
for the station's work. A machine that is twice as slow is given twice the time, and one that gets
slower between the two measurements is seen by the drift.
"""

import ctypes
import functools
import math
import shutil
import statistics
import struct
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from autonomy.vehicle.config import MINIGLIDER

DT_S = 0.01
STEPS = 2_000
"""Steps of one call: less than a scheduler's slice, so that some calls run undisturbed."""
SLICES = 200
"""Calls of one calibration."""
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "%": 1e-2}
"""Seconds of a row's unit; a share of a core is so many hundredths of a second in a second."""
Statistic = Literal["best", "median", "wall"]
"""Which time of the yardstick a row is held against: the least time, for rows that take the best of
many; the median of the processor's time, for medians and sums of it; the mean of the wall clock,
for delays, which other programs lengthen."""

_SOURCE = Path(__file__).parent / "flight" / "vehicle.c"


class NotMeasuredError(Exception):
    """An area came to no figure, and the machine or the product has to change; says why."""


@dataclass(frozen=True, slots=True)
class Yardstick:
    """A fixed piece of work, and what it takes on the machine on which the bars were set."""

    name: str
    unit: str
    reference_s: float
    work: Callable[[], Callable[[], object] | None]
    """Returns one slice of the work; None where this machine cannot do it."""
    per_slice: int


@dataclass(slots=True)
class Calibration:
    """What a yardstick took on this machine, before and after something was measured."""

    yardstick: Yardstick
    before: dict[Statistic, float] | None = None
    after: dict[Statistic, float] | None = field(default=None)

    def taken_s(self, statistic: Statistic) -> float | None:
        """Return seconds of one yardstick; None where this machine cannot measure it."""
        if self.before is None or self.after is None:
            return None
        return 0.5 * (self.before[statistic] + self.after[statistic])

    def drift(self, statistic: Statistic) -> float:
        """Return how much slower the machine was afterwards than before; 1 where it was not."""
        if self.before is None or self.after is None:
            return 1.0
        return self.after[statistic] / self.before[statistic]


@contextmanager
def calibrated(yardstick: Yardstick) -> Iterator[Calibration]:
    """Measure the yardstick before and after what happens inside."""
    work = yardstick.work()
    calibration = Calibration(yardstick)
    if work is not None:
        calibration.before = _timed(yardstick, work)
    yield calibration
    if work is not None:
        calibration.after = _timed(yardstick, work)


def _timed(yardstick: Yardstick, work: Callable[[], object]) -> dict[Statistic, float]:
    work()
    wall_s: list[float] = []
    processor_s: list[float] = []
    for _ in range(SLICES):
        begin, busy = time.perf_counter(), time.process_time()
        work()
        processor_s.append(time.process_time() - busy)
        wall_s.append(time.perf_counter() - begin)
    count = yardstick.per_slice
    return {
        "best": min(processor_s) / count,
        "median": statistics.median(processor_s) / count,
        "wall": statistics.mean(wall_s) / count,
    }


def best_of(run: Callable[[], object], rounds: int) -> float:
    """Return the least processor time of some runs after a first one, s.

    A run that is longer than a scheduler's slice is interrupted on a busy machine; its processor
    time is not lengthened by that.
    """
    run()
    best_s = math.inf
    for _ in range(rounds):
        begin = time.process_time()
        run()
        best_s = min(best_s, time.process_time() - begin)
    return best_s


def scaled_row(
    area: str,
    name: str,
    value: float,
    unit: str,
    bar: float,
    calibration: Calibration,
    *,
    by: Statistic = "best",
    at_least: bool = False,
) -> dict[str, Any]:
    """Make a line of the report whose bar moves with the speed of the machine.

    Args:
        area: The benchmark.
        name: What was measured.
        value: What it took, or how many were done in a second.
        unit: Of the value and of the bar.
        bar: On the reference machine.
        calibration: Measured around the value.
        by: The yardstick's statistic that suits the way in which the value was measured.
        at_least: The value is a rate; otherwise it is a time or a share of a core.

    Returns:
        The line: ``bar`` as it is on this machine, ``ratio`` and ``ratio_bar`` in yardsticks (or
        per yardstick), which mean the same on every machine, and what the yardstick took.
    """
    yardstick, taken_s = calibration.yardstick, calibration.taken_s(by)
    row: dict[str, Any] = {"area": area, "name": name, "value": float(value), "unit": unit}
    if taken_s is None:
        return row | {"bar": None, "met": None, "unit": f"{unit}; no C compiler to calibrate"}
    slowness = taken_s / yardstick.reference_s
    one = taken_s if at_least else SECONDS[unit] / taken_s
    reference = yardstick.reference_s if at_least else SECONDS[unit] / yardstick.reference_s
    ratio, ratio_bar = float(value) * one, bar * reference
    return row | {
        "bar": bar / slowness if at_least else bar * slowness,
        "met": bool(ratio >= ratio_bar if at_least else ratio <= ratio_bar),
        "ratio": ratio,
        "ratio_bar": ratio_bar,
        "calibration": {
            "yardstick": yardstick.name,
            "unit": yardstick.unit,
            "value": taken_s / SECONDS[yardstick.unit],
            "reference": yardstick.reference_s / SECONDS[yardstick.unit],
            "slowness": slowness,
            "drift": calibration.drift(by),
        },
    }


def plain_c(
    state: np.ndarray, inputs: np.ndarray, packed: np.ndarray
) -> Callable[[], np.ndarray] | None:
    """Return ``STEPS`` steps of the vehicle's C twin as one call; None where there is no gcc."""
    function = _library()
    if function is None:
        return None

    def plain() -> np.ndarray:
        x = state.copy()
        function(x, inputs, packed, DT_S, STEPS)
        return x

    return plain


def start() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a state, inputs and the packed Miniglider, of which the steps are timed."""
    state = np.zeros(12)
    state[6] = 0.06
    return state, np.array([0.010, 0.020, 0.3]), MINIGLIDER.packed()


@functools.cache
def _library() -> Callable[..., None] | None:
    gcc = shutil.which("gcc")
    if gcc is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "vehicle.so"
        flags = ["-O3", "-march=native", "-shared", "-fPIC"]
        command = [gcc, *flags, str(_SOURCE), "-o", str(library), "-lm"]
        subprocess.run(command, check=True, timeout=120)
        function = ctypes.CDLL(str(library)).rk4_steps
    pointer = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
    function.argtypes = [pointer, pointer, pointer, ctypes.c_double, ctypes.c_long]
    function.restype = None
    return function


@dataclass(frozen=True, slots=True)
class _Reading:
    name: str
    value: float
    at: int


def _python_slice() -> float:
    """Pack, unpack, name, look up and add, as a station does with what it hears."""
    form = struct.Struct("<Ihd")
    newest: dict[str, _Reading] = {}
    total = 0.0
    for i in range(1_500):
        at, channel, value = form.unpack(form.pack(i, i % 100, 0.5 * i))
        reading = _Reading(f"channel_{channel}", value + at, i)
        old = newest.get(reading.name)
        if old is None or old.at < reading.at:
            newest[reading.name] = reading
        total += sum(each.value for each in (reading,))
    return total + len(",".join(sorted(newest)))


COMPILED = Yardstick("plain C step", "us", 0.30e-6, lambda: plain_c(*start()), per_slice=STEPS)
PYTHON = Yardstick("Python loop", "ms", 1.43e-3, lambda: _python_slice, per_slice=1)
