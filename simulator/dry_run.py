"""Flies a plan by the readable onboard program, a few times.

The station flies plans ahead by the kernel (``simulator.ahead``); this is the reference. The robot
is the simulated one: same onboard program, same body. Its instruments have noise, its actuators
just the offsets that the mission's trim corrects, and the water has eddies that carry it away as
fast as the planner assumes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from autonomy.current.table import table_of
from autonomy.estimation.known_current import SETTLING_S
from autonomy.planner.plan import PositionNed
from onboard.link.robot_link import CommandOutcome
from onboard.profile import FLIGHT_PROFILES
from robot_link.dry_run import DryRun, DryRunProblem
from robot_link.messages import CommandKind, OnboardPlanState, RobotMode, StateReport
from simulator.ahead.comparison import Flight, compared
from simulator.fleet import FLEET, RobotDefinition
from simulator.flow import Tabled
from simulator.robot import SimulatedRobot

_EPOCH = datetime(2000, 1, 1, tzinfo=UTC)
_ROW_EVERY = 10
"""Steps of the onboard program between two rows of a track."""
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
    return compared(problem, flights)


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


def definition_of(problem: DryRunProblem, current_ne_m_s: tuple[float, float]) -> RobotDefinition:
    """Return the robot of a flight in its water.

    Raises:
        ValueError: If there is no simulated robot of this vehicle.
    """
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
                current_ne_m_s=current_ne_m_s,
                flow=None if problem.flow is None else Tabled(table_of(problem.flow)),
            )
    raise ValueError(f"there is no simulated robot of the vehicle {problem.vehicle.key}")


def _robot(problem: DryRunProblem, number: int) -> SimulatedRobot:
    """Return a robot that floats at the start, with the faults that the trim is for."""
    current, seed = _current_ne_m_s(problem, number), problem.seed + number
    definition = definition_of(problem, current)
    robot = SimulatedRobot(definition, seed, _EPOCH, water_s=-SETTLING_S)
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
    while program.time_s < SETTLING_S:
        robot.step(radio)
    program.take_plan(problem.mission)
    if program.obey(CommandKind.START, problem.mission.sha256()) is not CommandOutcome.DONE:
        flight.reason = executive.reason or "the robot did not start"
        return flight
    began_s, steps = program.time_s, 0
    rows: list[tuple[float, ...]] = []
    places: list[tuple[float, float]] = []
    while executive.plan_state is OnboardPlanState.RUNNING:
        if steps % _LOOK_EVERY == 0 and is_cancelled():
            raise DryRunCancelledError
        robot.step(radio)
        steps += 1
        if steps % _ROW_EVERY == 0:
            north, east, _ = robot.body.plant.position_ned
            places.append((north, east))
            if executive.is_sampling:
                rows.append((program.time_s - began_s, executive.leg, *_place(robot)))
        _note_surfacing(flight, robot)
    flight.rows, flight.places = np.array(rows).reshape(-1, 9), np.array(places).reshape(-1, 2)
    flight.duration_s = program.time_s - began_s
    flight.energy = executive.energy_used
    if executive.plan_state is not OnboardPlanState.DONE:
        flight.reason = executive.reason
    return flight


def _place(robot: SimulatedRobot) -> tuple[float, ...]:
    """Return where the robot is, where it believes to be, and what it says of that."""
    estimate = robot.program.estimate
    return *robot.body.plant.position_ned, *estimate.position_ned, estimate.position_std_m


def _note_surfacing(flight: Flight, robot: SimulatedRobot) -> None:
    """Write down where the robot came up after a leg."""
    north, east, depth = robot.body.plant.position_ned
    executive = robot.program.executive
    if executive.is_sampling:
        flight.leg = executive.leg
    elif depth < FLIGHT_PROFILES[robot.definition.vehicle.key].surfaced_m:
        flight.surfaced.setdefault(flight.leg, (north, east))
