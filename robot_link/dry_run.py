"""What a dry run is given and leaves: a mission flown against the full dynamics, ashore.

The dry run itself needs the simulated robot, so a worker process runs it by its name.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.current.table import FlowRecord
from autonomy.site import Area, Site
from autonomy.vehicle.config import Vehicle
from robot_link.mission import Mission

DRY_RUN: Final = "simulator.ahead.ensemble:run"
"""Name of the task: takes a ``DryRunProblem``, reports the share that is done, leaves a
``DryRun``."""


@dataclass(frozen=True, slots=True)
class Spread:
    """How far the robots and the water of many flights differ, one from the other.

    Shares are standard deviations of normal numbers, as parts of what is told; the delivered ones
    are those that the robot's filter assumes, or what nobody can know of a battery.
    """

    model_share: float | None = None
    """Of drag, side force, lift, and the moments about the pitch and the yaw axis, each for itself;
    ``None`` is what the filter assumes of the vehicle's model."""
    drift_share: float = 0.2
    """Of how fast the water carries the robot away unseen."""
    flow_share: float = 0.2
    """Of the strength of the current that is told by place and time."""
    ballast_share: float = 1.0
    """Of the errors of the feedback of pump and sliding mass, in those of the sensors' model."""
    noise_share: float = 0.2
    """Of the sensors' noise."""
    capacity_share: float = 0.05
    """Of the battery's capacity."""
    power_share: float = 0.1
    """Of what electronics and actuators draw."""


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
    known_current_std_m_s: float | None = None
    """How well the robot says that it knows the current when it begins, standard deviation per
    axis, the doubt not counted; ``None`` where it knows as little as when it is switched on."""
    doubt: float = 1.0
    """How many times larger than its filter's own it states deviations when it begins."""
    runs: int = 4
    """How many times it is flown, each in other eddies."""
    seed: int = 0
    keep_outs: tuple[Area, ...] = ()
    """Parts of the surface that no plan enters; whoever is carried into one must be told of."""
    spread: Spread = Spread()
    """How far the flights differ beside."""
    battery: float = 1.0
    """Charge at the start, part of a full battery."""
    capacity_wh: float | None = None
    """Of the full battery; ``None`` is that of the vehicle."""
    greatest_chance: float = 1.0
    """Part of the flights that may leave the water or enter a keep-out; 1 is no limit."""
    processor_s: float = math.inf
    """No further flight begins once so much processor time is used, but for the least number."""


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
class Chance:
    """How often something happened in the flights."""

    name: str
    share: float
    """Part of the flights, 0..1."""


@dataclass(frozen=True, slots=True)
class FailedFlight:
    """A flight that could not be computed, which says nothing of the mission."""

    number: int
    """Among the flights of its dry run, counted from 0."""
    seed: int
    """Of the dry run; with the number it repeats the flight."""
    reason: str


@dataclass(frozen=True, slots=True)
class LegOut:
    """Flights that were out of the water, or in a keep-out, for the first time on one leg."""

    leg: int
    """Counted from 0."""
    where: str
    """The keep-out's name, or "the water" that they left."""
    flights: int
    beyond_m: float
    """How far out, or in, they came at most on their whole way, m; the median of them."""


@dataclass(frozen=True, slots=True)
class Safety:
    """How often flights were where none may be."""

    flights: int
    out: int
    """Of them left the water or entered a keep-out, at whatever depth."""
    legs: tuple[LegOut, ...]
    """By the leg on which they first did."""
    short_m: float
    """So much farther in, all flights would be out as rarely as the problem allows, m; 0 where they
    are."""

    @property
    def chance(self) -> float:
        """Chance that another flight is (Laplace's rule, so that few flights promise little)."""
        return (self.out + 1.0) / (self.flights + 2.0)


def allowed_flights(chance: float, flights: int) -> int:
    """Return how many flights may be out for ``Safety.chance`` to be no more; -1: not even none."""
    return math.floor(chance * (flights + 2.0) - 1.0 + 1e-9)


@dataclass(frozen=True, slots=True)
class SurfacingBand:
    """When and where the flights came up after a leg."""

    leg: int
    """Counted from 0."""
    share: float
    """Part of the flights that did."""
    time_s: tuple[float, float, float]
    """Low, median and high of the band, s since the start."""
    north_m: float
    """Of the middle of the ellipse."""
    east_m: float
    ellipse_m: tuple[float, float]
    """Half axes of the ellipse that holds the band's part of them, the longer first."""
    ellipse_rad: float
    """Direction of the longer axis, from north towards east."""
    battery: tuple[float, float, float]
    """Charge then: low, median and high, parts of a full battery."""


@dataclass(frozen=True, slots=True, eq=False)
class FlightBand:
    """Where the flights were, and what became of them; held by ``level`` of them."""

    level: float
    """Part of the flights that a band holds, 0..1."""
    along: FloatArray
    """Along the legs, a row for each of a few shares of each leg, shape ``(n, 15)``: leg, time of
    the plan s, median time since the start s; low and high of north, of east and of depth m; north
    and east of the middle of the ellipse m; its half axes m, the longer first, and its direction
    rad; part of the flights that came so far."""
    over_time: FloatArray
    """A row a moment, shape ``(m, 14)``: time since the start s; low, median and high of north, of
    east, of depth m, and of the charge 0..1; part of the flights under way. A flight that has ended
    stays where it came up."""
    surfacings: tuple[SurfacingBand, ...]
    battery_end: tuple[float, float, float]
    """Charge at the end: low, median and high."""
    duration_s: tuple[float, float, float]
    worst_std_m: tuple[float, float, float]
    """Largest deviation of the position that the robot states on the way."""
    leaves_water: float
    """Probability that it is outside of the water's outline at some time."""
    leaves_domain: float
    """Probability that it is outside of the water's box to explore."""
    touches: tuple[Chance, ...]
    """Probability of being in each keep-out at some time."""
    not_back: float
    """Probability of not coming back as planned: mission failed, or the water left."""
    outcomes: tuple[Chance, ...]
    """How the flights ended, shares that add up to 1."""
    dives_cut: float
    """Probability that a limit ends a dive early."""


@dataclass(frozen=True, slots=True)
class DryRun:
    """How a mission goes when it is flown against the full dynamics."""

    completed: bool
    """Whether the runs flew the whole mission: all of a few, four in five of many."""
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
    """Names of the keep-outs that the robot was in, at whatever depth: in any of a few runs, in
    more than one in five of many."""
    track: DryRunTrack
    """First run."""
    expected: FloatArray | None = None
    """Expected track, shape ``(n, 5)``: time of the plan s, without what prepares legs at the
    surface; north, east, down m, the mean of where the flights were at the same share of the same
    leg; and the position's std that they stated there, m. It has as many rows for each leg, so a
    leg's last and the next one's first have the same time. ``None`` for a single flight and where
    not ``completed``: then the plan's own points are what can be expected."""
    expected_times_s: tuple[tuple[float, float], ...] = ()
    """When each leg of the expected track begins and ends, s since the start, surfacings
    included."""
    spread_m: float | None = None
    """Horizontal distance of one more flight from the expected track, root mean square, as the
    scatter of the flights tells it."""
    band: FlightBand | None = None
    """Of many flights."""
    safety: Safety | None = None
    """Likewise."""
    failed: tuple[FailedFlight, ...] = ()
    """Flights that could not be computed; all else is told by the others."""
    not_rehearsed: str = ""
    """What was left out, for a person."""

    def document(self) -> dict[str, Any]:
        """Return it as a JSON object; the track is rows of time, true north, east, down, std."""
        values = asdict(self)
        del values["track"]
        if self.band is not None:
            values["band"] |= {
                "along": self.band.along.round(3).tolist(),
                "over_time": self.band.over_time.round(3).tolist(),
            }
        track = self.track
        rows = np.column_stack([track.time_s, track.true_ned, track.stated_std_m])
        expected = [] if self.expected is None else self.expected.round(3).tolist()
        return values | {"flown": rows.round(3).tolist(), "expected": expected}
