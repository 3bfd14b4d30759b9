"""What a dry run is given and leaves: a mission flown against the full dynamics, ashore.

The dry run itself needs the simulated robot, so a worker process runs it by its name.
"""

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.current.table import FlowRecord
from autonomy.site import Area, Site
from autonomy.vehicle.config import Vehicle
from robot_link.mission import Mission

DRY_RUN: Final = "simulator.dry_run:run"
"""Name of the task: takes a ``DryRunProblem``, reports the share that is done, leaves a
``DryRun``."""


@dataclass(frozen=True, slots=True, eq=False)
class DryRunProblem:
    """A mission, the robot that is to fly it, and the water that it is thought to meet."""

    mission: Mission
    planned_points: FloatArray
    """What the plan promises, shape ``(n, 5)``: time s (surfacings left out), north, east, down m,
    position standard deviation m."""
    vehicle: Vehicle
    """Its key names the robot whose instruments and manners are taken."""
    site: Site
    start_ne_m: tuple[float, float]
    """Where the robot floats before it starts."""
    heading_rad: float
    drift_m_sqrt_s: float
    """How fast the water carries it away unseen, m per sqrt(s), per axis."""
    current_ne_m_s: tuple[float, float] = (0.0, 0.0)
    """Current that stays and that the robot does not know of."""
    flow: FlowRecord | None = None
    """Current by place, depth and time since the start, on top."""
    unknown_current_std_m_s: float = 0.0
    """Standard deviation per axis of what nobody knows of the current that stays; each flight meets
    another part of it, and they cancel over all flights."""
    runs: int = 4
    """How many times it is flown, each in other eddies."""
    seed: int = 0
    keep_outs: tuple[Area, ...] = ()
    """Parts of the surface that no plan enters; whoever is carried into one must be told of."""


@dataclass(frozen=True, slots=True, eq=False)
class DryRunTrack:
    """One flight; all arrays have a row for each moment on a leg, about a second apart."""

    time_s: FloatArray
    """Since the start, surfacings included, shape ``(n,)``."""
    true_ned: FloatArray
    """Where the robot really was, shape ``(n, 3)``, m."""
    believed_ned: FloatArray
    """Where it believed to be, shape ``(n, 3)``, m."""
    stated_std_m: FloatArray
    """What it said of that, shape ``(n,)``, m."""
    planned_ned: FloatArray
    """Where the plan has it at the same share of the same leg, shape ``(n, 3)``, m."""
    planned_std_m: FloatArray
    """Uncertainty of the position that the plan predicts there, shape ``(n,)``, m."""


@dataclass(frozen=True, slots=True)
class DryRun:
    """How a mission goes when it is flown against the full dynamics."""

    completed: bool
    """Whether every run flew the whole mission."""
    message: str
    """How it went, for a person."""
    rms_error_m: float
    """Horizontal distance between flown and planned place, root mean square of all runs."""
    worst_error_m: float
    surfacing_error_m: float
    """Greatest distance between a planned surfacing and the real one."""
    position_error_m: float
    """Horizontal distance between where the robot was and where it believed to be, root mean
    square of all runs."""
    predicted_error_m: float
    """The same as the plan predicts it."""
    planned_worst_std_m: float
    within_share: float
    """Part of the flown moments nearer to the planned place than its 95 % circle says."""
    duration_s: float
    """Mean of the runs, surfacings included."""
    energy: float
    """Mean of the runs, energy units."""
    runs: int
    entered: tuple[str, ...]
    """Names of the keep-outs that the robot was in, in any run, at whatever depth."""
    track: DryRunTrack
    """First run."""
    expected: FloatArray | None = None
    """Expected track, shape ``(n, 5)``: time of the plan s, without what prepares legs at the
    surface; north, east, down m, the mean of where the flights were at the same share of the same
    leg; and the position's std that they stated there, m. It has as many rows for each leg, so a
    leg's last and the next one's first have the same time. ``None`` unless all of at least two
    flights came to the end: then the plan's own points are what can be expected."""
    expected_times_s: tuple[tuple[float, float], ...] = ()
    """When each leg of the expected track begins and ends, s since the start, surfacings
    included."""
    spread_m: float | None = None
    """Horizontal distance of one more flight from the expected track, root mean square, as the
    scatter of the flights tells it."""

    def document(self) -> dict[str, Any]:
        """Return it as a JSON object; the track is rows of time, true north, east, down, std."""
        values = asdict(self)
        del values["track"]
        track = self.track
        rows = np.column_stack([track.time_s, track.true_ned, track.stated_std_m])
        expected = [] if self.expected is None else self.expected.round(3).tolist()
        return values | {"flown": rows.round(3).tolist(), "expected": expected}
