"""Light requests while the station works: six robots plan at once and their maps are fitted.

A real demo with six robots. What a page asks for all the time is asked again and again while every
robot's plan is made; the same at rest stands beside it.
"""

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.calibration import PYTHON, NotMeasuredError, calibrated, scaled_row
from tests.e2e.demo import Demo

AREA = "busy"
ROBOTS = "mini-1..3,grace-1..3"
PATHS = ("/api/robots", "/api/alarms", "/api/robots/mini-1/state", "/api/health")
LATE_BAR_MS = 300.0
REST_S = 15.0
ASK_S = 0.05
LIMIT_S = 900.0


def measure() -> list[dict[str, Any]]:
    """Ask at rest and beside planning.

    Raises:
        NotMeasuredError: If the plans do not come.
    """
    with tempfile.TemporaryDirectory() as folder, Demo(Path(folder), "--robots", ROBOTS) as demo:
        demo.sign_in()
        robots = [robot["id"] for robot in demo.client.get("/api/robots").json()]
        until_s = time.monotonic() + REST_S
        rest_ms = _asked(demo, lambda: time.monotonic() < until_s)
        with calibrated(PYTHON) as calibration:
            plans = [demo.post(f"/api/robots/{robot}/plans", {})["id"] for robot in robots]
            begun_s = time.monotonic()
            busy_ms = _asked(demo, lambda: _is_planning(demo, plans, begun_s))
    load = f"{len(robots)} robots plan, {len(busy_ms)} answers, load {os.getloadavg()[0]:.1f}"
    return [
        scaled_row(AREA, f"{name}, p{percent}", value, "ms", LATE_BAR_MS, calibration, by="wall")
        for name, asked_ms in (("Answers at rest", rest_ms), (f"Answers while {load}", busy_ms))
        for percent in (50, 95)
        for value in (float(np.percentile(asked_ms, percent)),)
    ]


def _asked(demo: Demo, goes_on: Callable[[], bool]) -> list[float]:
    """Return how long each answer took, ms."""
    taken_ms: list[float] = []
    while goes_on():
        for path in PATHS:
            asked_s = time.monotonic()
            demo.client.get(path).raise_for_status()
            taken_ms.append(1e3 * (time.monotonic() - asked_s))
            time.sleep(ASK_S)
    return taken_ms


def _is_planning(demo: Demo, plans: list[str], begun_s: float) -> bool:
    if time.monotonic() - begun_s > LIMIT_S:
        raise NotMeasuredError(f"six plans were not made in {LIMIT_S:g} s")
    return any(demo.get(f"/api/plans/{plan}")["state"] == "planning" for plan in plans)
