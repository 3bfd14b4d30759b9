"""One compiled flight: a plan that is packed once, what the flight meets, and what came of it."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.current.table import FlowTable
from robot_link.mission import Mission
from simulator.ahead import executive, kernel, pack
from simulator.ahead.drawn import Drawn
from simulator.ahead.state import NOISE, SENSED, Water
from simulator.fleet import RobotDefinition

_CHUNK = 4096
"""Steps between two questions whether to go on."""
_ROWS_A_LEG = 12
TIMED_OUT, BATTERY, LOST = executive.TIMED_OUT, executive.BATTERY, executive.LOST


class FlightCancelledError(Exception):
    """Whoever asked does not want to know any more."""


@dataclass(frozen=True, slots=True)
class FlightPlan:
    """A mission, its robot and its water, packed for any number of flights."""

    definition: RobotDefinition
    """Its vehicle is what the onboard program believes."""
    mission: Mission
    course: pack.Course
    water: Water
    grain: pack.Grain
    row_s: float
    """Time between two rows of the track."""

    @classmethod
    def of(
        cls,
        definition: RobotDefinition,
        mission: Mission,
        grain: pack.Grain,
        row_s: float,
        flow: FlowTable | None = None,
    ) -> "FlightPlan":
        """Pack a mission."""
        course = pack.course_of(mission, definition.vehicle)
        water = pack.water_of(definition.site, flow)
        return cls(definition, mission, course, water, grain, row_s)


@dataclass(frozen=True, slots=True)
class Flown:
    """What came of a flight."""

    rows: FloatArray
    """By the columns of ``state``."""
    changes: FloatArray
    """Time, mode, leg and whether it is on that leg, at each change, shape ``(n, 4)``."""
    surfaced: FloatArray
    """As of ``state.Record``."""
    is_done: bool
    reason: int
    """Of ``TIMED_OUT``, ``BATTERY`` and ``LOST``; 0 for a mission that was flown whole."""
    duration_s: float
    energy: float
    battery: float
    """Charge at the end."""
    worst_std_m: float
    """Largest deviation of the position that the robot stated."""
    dives_cut: int
    """Dives that a limit ended early."""


def fly(
    plan: FlightPlan,
    drawn: Drawn,
    generator: np.random.Generator,
    is_cancelled: Callable[[], bool] = lambda: False,
) -> Flown:
    """Fly a mission once.

    Raises:
        FlightCancelledError: It was stopped.
    """
    flight = _Flight(plan, drawn, generator.standard_normal(2 + 2 * SENSED))
    while flight.is_flying:
        if is_cancelled():
            raise FlightCancelledError
        flight.fly_on(generator.standard_normal((_CHUNK, NOISE)))
    return flight.outcome()


def fly_with(plan: FlightPlan, drawn: Drawn, first: FloatArray, noise: FloatArray) -> Flown:
    """Fly a mission with given noise; it ends with that at the latest.

    Args:
        plan: What is flown.
        drawn: What the flight meets.
        first: Standard normal numbers of the beginning, as of ``kernel.begin``.
        noise: Those of each step, shape ``(n, NOISE)``.
    """
    flight = _Flight(plan, drawn, first)
    flight.fly_on(noise)
    return flight.outcome()


class _Flight:
    """A flight under way."""

    def __init__(self, plan: FlightPlan, drawn: Drawn, first: FloatArray) -> None:
        definition, mission, grain = plan.definition, plan.mission, plan.grain
        legs, row_s = len(plan.course.legs), plan.row_s
        longest_s = drawn.settling_s + mission.settings.timeout_s + executive.LOST_S
        rows = math.ceil(longest_s / row_s) + _ROWS_A_LEG * legs + 100
        self._plan = plan
        self._robot = pack.robot_of(definition.vehicle, drawn.vehicle, definition.site)
        self._setup = pack.setup_of(definition, mission, plan.course, drawn, grain)
        self._setup[0]["row_every"] = max(1, round(row_s / grain.period_s))
        self._state = pack.state_of(definition, mission, drawn.battery)
        self._record = pack.record_for(legs, rows)
        flow = plan.water.flow
        scaled = flow._replace(values=drawn.flow_share * flow.values)
        self._water = plan.water._replace(flow=scaled)
        args = (self._state, self._setup, self._robot, self._water, plan.course.legs)
        kernel.begin(*args, first)

    @property
    def is_flying(self) -> bool:
        return self._state[0]["plan_state"] in (executive.ON_BOARD, executive.RUNNING)

    def fly_on(self, noise: FloatArray) -> None:
        course = self._plan.course
        args = (self._state, self._setup, self._robot, self._water, course.legs, course.polars)
        kernel.fly(*args, noise, self._record)

    def outcome(self) -> Flown:
        s, record = self._state[0], self._record
        return Flown(
            rows=record.rows[: s["row"]].copy(),
            changes=record.changes[: s["change"]].copy(),
            surfaced=record.surfaced,
            is_done=bool(s["plan_state"] == executive.DONE),
            reason=int(s["reason"]),
            duration_s=float(s["mission_s"]),
            energy=float(s["settled_energy"] + s["leg_work"] * s["leg_share"]),
            battery=float(s["battery"]),
            worst_std_m=float(s["worst_std_m"]),
            dives_cut=int(s["dives_cut"]),
        )
