"""Flies a plan against the full dynamics before anybody sends it.

The robot of a dry run is the simulated one: same onboard program, same body. Its instruments have
noise, its actuators just the offsets that the mission's trim corrects, and the water has eddies
that carry it away as fast as the planner assumes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.current.table import table_of
from autonomy.planner.plan import PositionNed
from autonomy.site import Area
from onboard.link.robot_link import CommandOutcome
from onboard.profile import FLIGHT_PROFILES
from robot_link.dry_run import DryRun, DryRunProblem, DryRunTrack
from robot_link.messages import CommandKind, OnboardPlanState, RobotMode, StateReport
from simulator.fleet import FLEET, RobotDefinition
from simulator.flow import Tabled
from simulator.robot import SimulatedRobot

_EPOCH = datetime(2000, 1, 1, tzinfo=UTC)
_SETTLING_S = 20.0
"""Time at the surface before the start, in which the robot's estimate settles."""
_CIRCLE_95 = math.sqrt(-2.0 * math.log(0.05))
"""Radius of the circle that holds 95 % of a round Gaussian, in standard deviations."""
_ROW_EVERY = 10
"""Steps of the onboard program between two rows of a track."""
_ROWS_MAX = 600
_SHARES = np.linspace(0.0, 1.0, 13)
"""Shares of a leg at which the expected track has a point."""
_RUNS_LEAST = 2
"""A single flight is no mean."""
_AT_SURFACE_M = 0.01
"""Planned depth of a surfacing, but for rounding."""
_LOOK_EVERY = 500
"""Steps between two questions whether to go on."""


class DryRunCancelledError(Exception):
    """Whoever asked does not want to know any more."""


def run(
    problem: DryRunProblem,
    report: Callable[[float], None],
    is_cancelled: Callable[[], bool],
) -> DryRun:
    """Fly a mission some times and compare the flights with the plan.

    Raises:
        ValueError: If there is no simulated robot of this vehicle.
        DryRunCancelledError: It was stopped.
    """
    flights: list[Flight] = []
    for number in range(problem.runs):
        flights.append(fly(problem, number, is_cancelled))
        report((number + 1) / problem.runs)
    return _compared(problem, flights)


@dataclass
class _Notebook:
    """A radio beside the robot: everything it says is heard at once."""

    unacknowledged_samples: int = 0
    reason: str = ""

    def set_mode(self, mode: RobotMode) -> None:
        pass

    def report_state(self, state: StateReport) -> None:
        pass

    def record_sample(
        self,
        variable: str,
        value: float,
        position_ned: PositionNed,
        position_std_m: float,
        measured_at: datetime,
    ) -> int:
        return 0

    def report_plan(
        self, state: OnboardPlanState, *, leg: int = 0, energy_used: float = 0.0, reason: str = ""
    ) -> None:
        self.reason = reason

    def begin_next_plan(self) -> None:
        pass


@dataclass
class Flight:
    """One run: rows of time, leg, true NED, believed NED, stated std."""

    rows: list[tuple[float, ...]] = field(default_factory=list)
    places: list[tuple[float, float]] = field(default_factory=list)
    """Where the robot truly was, north and east, all the time."""
    surfaced: dict[int, tuple[float, float]] = field(default_factory=dict)
    """Where the robot truly was when the leg of this number ended at the surface."""
    duration_s: float = 0.0
    energy: float = 0.0
    reason: str = ""
    """Why it did not fly the whole mission; empty if it did."""
    leg: int = -1
    """Leg flown last."""


def _current_ne_m_s(problem: DryRunProblem, number: int) -> tuple[float, float]:
    """Return the current that stays in one of the flights, m/s.

    To what is told comes what nobody knows of it, in each flight another way, evenly all around,
    so that it cancels in the mean track; a single flight meets none.
    """
    north, east = problem.current_ne_m_s
    if problem.runs == 1:
        return north, east
    first = 2.0 * math.pi * np.random.default_rng(problem.seed).random()
    angle = first + 2.0 * math.pi * number / problem.runs
    length = math.sqrt(2.0) * problem.unknown_current_std_m_s
    return north + length * math.cos(angle), east + length * math.sin(angle)


def _definition(problem: DryRunProblem, number: int) -> RobotDefinition:
    """Return the robot of one of the flights in its water; what flows there is settled here."""
    for known in FLEET.values():
        if known.vehicle.key == problem.vehicle.key:
            return replace(
                known,
                vehicle=problem.vehicle,
                site=problem.site,
                start_ne_m=problem.start_ne_m,
                heading_rad=problem.heading_rad,
                drift_m_sqrt_s=problem.drift_m_sqrt_s,
                instruments=(),
                current_ne_m_s=_current_ne_m_s(problem, number),
                flow=None if problem.flow is None else Tabled(table_of(problem.flow)),
            )
    raise ValueError(f"there is no simulated robot of the vehicle {problem.vehicle.key}")


def _robot(problem: DryRunProblem, number: int) -> SimulatedRobot:
    """Return a robot that floats at the start, with the faults that the trim is for."""
    definition, seed = _definition(problem, number), problem.seed + number
    robot = SimulatedRobot(definition, seed, _EPOCH, water_s=-_SETTLING_S)
    settings = problem.mission.settings
    robot.body.sensors.buoyancy_bias_kg = settings.net_buoyancy_offset_kg
    robot.body.sensors.mass_position_bias_m = settings.mass_position_offset_m
    return robot


def fly(problem: DryRunProblem, number: int, is_cancelled: Callable[[], bool]) -> Flight:
    """Fly a mission once.

    Args:
        problem: The mission and its water.
        number: Which of the flights this is; each meets other eddies.
        is_cancelled: Asked now and then whether to stop.

    Raises:
        ValueError: If there is no simulated robot of this vehicle.
        DryRunCancelledError: It was stopped.
    """
    robot, radio, flight = _robot(problem, number), _Notebook(), Flight()
    program, executive = robot.program, robot.program.executive
    while program.time_s < _SETTLING_S:
        robot.step(radio)
    program.take_plan(problem.mission)
    if program.obey(CommandKind.START, problem.mission.sha256()) is not CommandOutcome.DONE:
        flight.reason = executive.reason or "the robot did not start"
        return flight
    began_s, steps = program.time_s, 0
    while executive.plan_state is OnboardPlanState.RUNNING:
        if steps % _LOOK_EVERY == 0 and is_cancelled():
            raise DryRunCancelledError
        robot.step(radio)
        steps += 1
        _note(flight, robot, program.time_s - began_s, steps)
    flight.duration_s = program.time_s - began_s
    flight.energy = executive.energy_used
    if executive.plan_state is not OnboardPlanState.DONE:
        flight.reason = executive.reason
    return flight


def _note(flight: Flight, robot: SimulatedRobot, time_s: float, steps: int) -> None:
    """Write down where the robot is on a leg, and where it came up after it."""
    truth, program = robot.body.plant.position_ned, robot.program
    if steps % _ROW_EVERY == 0:
        flight.places.append((truth[0], truth[1]))
    if program.executive.is_sampling:
        flight.leg = program.executive.leg
        if steps % _ROW_EVERY == 0:
            estimate = program.estimate
            place = (*truth, *estimate.position_ned, estimate.position_std_m)
            flight.rows.append((time_s, flight.leg, *place))
    elif truth[2] < FLIGHT_PROFILES[robot.definition.vehicle.key].surfaced_m:
        flight.surfaced.setdefault(flight.leg, (truth[0], truth[1]))


class _Plan:
    """The plan by leg: where it has the robot at a share of a leg."""

    def __init__(self, problem: DryRunProblem) -> None:
        settings, legs = problem.mission.settings, problem.mission.legs
        begin = np.array([[0.0, settings.start_x_m, settings.start_y_m, 0.0, np.nan]])
        begin[0, 4] = problem.planned_points[0, 4]
        self._points = np.concatenate([begin, problem.planned_points])
        self._ends_s = np.cumsum([leg.duration_s for leg in legs])
        self._durations_s = np.array([leg.duration_s for leg in legs])
        self.legs = len(legs)

    def time_s(self, leg: IntArray, share: FloatArray) -> FloatArray:
        """Return the plan's time at shares of legs, shape ``(n,)``."""
        return self._ends_s[leg] - (1.0 - share) * self._durations_s[leg]

    def at(self, leg: IntArray, share: FloatArray) -> FloatArray:
        """Return north, east, down and position std at shares of legs, shape ``(n, 4)``."""
        time_s, points = self.time_s(leg, share), self._points
        return np.column_stack([np.interp(time_s, points[:, 0], points[:, k]) for k in range(1, 5)])


def _with_expectation(found: DryRun, plan: _Plan, flights: list[Flight]) -> DryRun:
    """Add where the flights were in the mean, if enough of them flew the whole plan.

    The scatter is that of one more flight: those that made the mean lie nearer to it.
    """
    runs, legs = len(flights), plan.legs
    if runs < _RUNS_LEAST or not found.completed:
        return found
    places = np.array([_by_share(flight, legs) for flight in flights])  # (runs, legs, shares, 5)
    mean = places.mean(axis=0)  # (legs, shares, 5)
    passed_s = np.maximum(mean[:, -1, 0] - mean[:, 0, 0], 1.0)  # (legs,)
    off_m2 = ((places - mean)[..., 1:3] ** 2).sum(axis=-1).mean(axis=(0, 2))  # (legs,)
    others = (runs + 1) / (runs - 1)
    spread_m = math.sqrt(others * float(np.average(off_m2, weights=passed_s)))
    leg = np.repeat(np.arange(legs), len(_SHARES))
    points = mean.reshape(-1, 5)
    times_s = tuple((begin, end) for begin, end in mean[:, (0, -1), 0].round(1).tolist())
    points[:, 0] = plan.time_s(leg, np.tile(_SHARES, legs))
    return replace(found, expected=points, expected_times_s=times_s, spread_m=spread_m)


def _by_share(flight: Flight, legs: int) -> FloatArray:
    """Return a flight at shares of its legs, shape ``(legs, shares, 5)``.

    Its columns: time since the start s, true north, east and down m, stated std m. A leg that was
    over at once, for the robot was where it ends already, is spent where the one before ended.
    """
    found = np.empty((legs, len(_SHARES), 5))
    rows = np.array(flight.rows)
    leg, share = leg_shares(rows)
    columns = rows[:, (0, 2, 3, 4, 8)]
    for number in range(legs):
        mine = leg == number
        if mine.any():
            for k in range(5):
                found[number, :, k] = np.interp(_SHARES, share[mine], columns[mine, k])
        else:
            found[number] = found[number - 1, -1] if number else columns[0]
    return found


def leg_shares(rows: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the leg of each row of a flight and the share of it that has passed."""
    time_s, leg = rows[:, 0], rows[:, 1].astype(np.int64)
    share = np.empty(len(rows))
    for number in np.unique(leg):
        mine = leg == number
        passed_s = time_s[mine] - time_s[mine][0]
        share[mine] = passed_s / max(float(passed_s[-1]), 1.0)
    return leg, share


def _track(plan: _Plan, flight: Flight) -> DryRunTrack:
    rows = np.array(flight.rows).reshape(-1, 9)
    planned = plan.at(*leg_shares(rows))
    return DryRunTrack(
        time_s=rows[:, 0],
        true_ned=rows[:, 2:5],
        believed_ned=rows[:, 5:8],
        stated_std_m=rows[:, 8],
        planned_ned=planned[:, :3],
        planned_std_m=planned[:, 3],
    )


def _surfacing_errors(plan: _Plan, flight: Flight) -> list[float]:
    """Return how far from its planned place each dive came up, m."""
    errors: list[float] = []
    for leg, place in flight.surfaced.items():
        if leg >= 0:
            planned = plan.at(np.array([leg]), np.ones(1))[0]
            if planned[2] < _AT_SURFACE_M:
                errors.append(math.dist(place, planned[:2].tolist()))
    return errors


def _compared(problem: DryRunProblem, flights: list[Flight]) -> DryRun:
    plan = _Plan(problem)
    tracks = [_track(plan, flight) for flight in flights]
    offsets = [track.true_ned[:, :2] - track.planned_ned[:, :2] for track in tracks]
    error_m = np.linalg.norm(np.concatenate(offsets), axis=1)
    lost = np.concatenate([(one.true_ned - one.believed_ned)[:, :2] for one in tracks])
    std_m = np.concatenate([track.planned_std_m for track in tracks])
    surfacings = [error for flight in flights for error in _surfacing_errors(plan, flight)]
    reasons = [flight.reason for flight in flights if flight.reason]
    entries = [_entered(problem.keep_outs, flight) for flight in flights]
    names = [area.name for area in problem.keep_outs]
    flown = bool(len(error_m))
    rms_m = _root_mean_square(error_m)
    worst_m = float(error_m.max()) if flown else 0.0
    within = float(np.mean(error_m <= _CIRCLE_95 * std_m)) if flown else 0.0
    found = DryRun(
        completed=not reasons,
        message=_sentence(len(flights), reasons, rms_m, worst_m) + _entry_sentences(names, entries),
        rms_error_m=rms_m,
        worst_error_m=worst_m,
        surfacing_error_m=max(surfacings, default=0.0),
        position_error_m=_root_mean_square(np.linalg.norm(lost, axis=1)),
        predicted_error_m=_root_mean_square(math.sqrt(2.0) * std_m),
        planned_worst_std_m=float(problem.planned_points[:, 4].max()),
        within_share=within,
        duration_s=float(np.mean([flight.duration_s for flight in flights])),
        energy=float(np.mean([flight.energy for flight in flights])),
        runs=len(flights),
        entered=tuple(name for name in names if any(name in one for one in entries)),
        track=_thinned(tracks[0]),
    )
    return _with_expectation(found, plan, flights)


def _root_mean_square(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _sentence(runs: int, reasons: list[str], rms_m: float, worst_m: float) -> str:
    if reasons:
        who = f"{len(reasons)} of {runs} times the robot" if runs > 1 else "The robot"
        return f"{who} did not fly the whole plan: {reasons[0]}."
    times = "once" if runs == 1 else f"{runs} times"
    return (
        f"Flown {times} against the full dynamics: {rms_m:.2g} m (rms) from the plan, "
        f"{worst_m:.2g} m at worst."
    )


def _entered(keep_outs: tuple[Area, ...], flight: Flight) -> frozenset[str]:
    """Return the names of the keep-outs that a flight led into."""
    north, east = np.array(flight.places, dtype=np.float64).reshape(-1, 2).T
    return frozenset(area.name for area in keep_outs if np.any(area.contains(north, east)))


def _entry_sentences(names: list[str], entries: list[frozenset[str]]) -> str:
    """Return a sentence for each keep-out that was entered, after a space."""
    text = ""
    for name in names:
        count = sum(name in one for one in entries)
        often = f" in {count} of {len(entries)} flights" if len(entries) > 1 else ""
        text += f' It enters the keep-out "{name}"{often}.' if count else ""
    return text


def _thinned(track: DryRunTrack) -> DryRunTrack:
    step = max(1, -(-len(track.time_s) // _ROWS_MAX))
    return DryRunTrack(
        track.time_s[::step],
        track.true_ned[::step],
        track.believed_ned[::step],
        track.stated_std_m[::step],
        track.planned_ned[::step],
        track.planned_std_m[::step],
    )
