"""What the check of a design of 500 legs takes: alone, and asked of a station by REST."""

import statistics
import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from autonomy.design.document import Design, Manner, Way, Waypoint
from autonomy.planner.preset import GRACE3
from autonomy.site import LAKE
from autonomy.vehicle.config import VEHICLES
from benchmarks.calibration import PYTHON, NotMeasuredError, calibrated, scaled_row
from benchmarks.station.station_process import served, viewer_token
from db.query.fleet.robots import RobotRecord, add_robot
from db.store import Store
from robot_link.messages import RobotId, SystemId
from robot_link.satellite.config import SatelliteConfig
from server.base.settings import Settings
from server.design.outline import Surroundings, outline_view

LEGS = 500
BAR_MS = 50.0
"""Where the Python loop takes what ``calibration`` says of the reference machine."""
ROUNDS = 21
ROBOT = RobotId("grace-3")
_LOW_M, _HIGH_M = 170.0, 330.0
_NEAREST_M, _FARTHEST_M = 12.0, 26.0


def measure() -> list[dict[str, Any]]:
    """Time the check of one design drawn at random in the lake, with a robot that is there.

    Raises:
        NotMeasuredError: If the station does not start, or the design has fewer legs.
    """
    rng = np.random.default_rng(3)
    design = drawn(rng)
    around = Surroundings(
        config=GRACE3,
        current_text="",
        site=LAKE,
        spacing_m=50.0,
        robot_ned=(250.0, 250.0, 0.0),
        battery_left=0.9,
        vehicle=VEHICLES["grace3"],
        tariff=SatelliteConfig().tariff,
        now=datetime.now(UTC),
    )
    count = len(outline_view(design, around).legs)
    if count < LEGS:
        raise NotMeasuredError(f"the design has {count} legs only")
    with calibrated(PYTHON) as alone:
        alone_ms = _median_ms(lambda: outline_view(design, around), time.process_time)
    with calibrated(PYTHON) as asked:
        asked_ms = _asked_ms(design)
    name = f"Check of a design of {count} legs"
    return [
        scaled_row("design_check", name, alone_ms, "ms", BAR_MS, alone, by="median"),
        scaled_row("design_check", f"{name}, by REST", asked_ms, "ms", BAR_MS, asked, by="wall"),
    ]


def drawn(rng: np.random.Generator) -> Design:
    """Return a yo-yo along a random way, of somewhat more than 500 legs.

    Every waypoint lies so far from the one before that a glide down and up fits between them; the
    robot comes up at each.
    """
    places = [rng.uniform(_LOW_M, _HIGH_M, 2)]
    while len(places) <= LEGS // 2:
        place = rng.uniform(_LOW_M, _HIGH_M, 2)
        if _NEAREST_M < float(np.hypot(*(place - places[-1]))) < _FARTHEST_M:
            places.append(place)
    waypoints = tuple(Waypoint(north_m=north, east_m=east) for north, east in places)
    return Design(content=Way(waypoints=waypoints), manner=Manner(deep_m=13.0))


def _asked_ms(design: Design) -> float:
    """Ask a station of its own, over one connection that stays open, and return the median."""
    with tempfile.TemporaryDirectory() as folder:
        token = _prepare(Path(folder))
        with served(Path(folder), token) as station:
            body = {"document": design.model_dump(mode="json")}
            path = f"/api/robots/{ROBOT}/designs/check"
            return _median_ms(lambda: station.post(path, body), time.perf_counter)


def _median_ms(run: Callable[[], object], clock: Callable[[], float]) -> float:
    run()
    taken_s: list[float] = []
    for _ in range(ROUNDS):
        began_s = clock()
        run()
        taken_s.append(clock() - began_s)
    return 1e3 * statistics.median(taken_s)


def _prepare(folder: Path) -> str:
    """Make a robot known to a fresh data folder and return a token."""
    store = Store.open(Settings(data_dir=folder).resolved_database_url)

    def write(session) -> str:
        robot = RobotRecord(
            id=ROBOT,
            name=ROBOT,
            model="grace3",
            kind="simulated",
            system_id=SystemId(1),
            links=("xbee://127.0.0.1:9",),
            site=LAKE,
            created_at=datetime.now(UTC),
        )
        add_robot(session, robot)
        return viewer_token(session)

    try:
        return store.change(write).result()
    finally:
        store.close()
