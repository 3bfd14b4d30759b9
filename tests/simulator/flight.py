"""Robots flown without radio or clock, as fast as they can be stepped."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np

from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import primitive
from autonomy.planner.plan import Leg, PositionNed
from autonomy.planner.preset import PLANNER_PRESETS
from onboard.link.robot_link import CommandOutcome
from robot_link.messages import CommandKind, OnboardPlanState, RobotMode, StateReport
from robot_link.mission import Mission, MissionSettings
from simulator.fleet import MINI_1, RobotDefinition
from simulator.robot import SimulatedRobot
from simulator.water_field import PLANNED

EPOCH = datetime(2026, 5, 1, tzinfo=UTC)
TANK_PLANNER = PLANNER_PRESETS["miniglider"]
LAKE_PLANNER = PLANNER_PRESETS["grace3"]


@dataclass
class Notebook:
    """A radio that writes down what the robot says, and whether samples were acknowledged.

    ``samples`` are those of the planned fields, ``others`` has those of other channels.
    """

    unacknowledged_samples: int = 0
    modes: list[RobotMode] = field(default_factory=list)
    plans: list[tuple[OnboardPlanState, int, float, str]] = field(default_factory=list)
    samples: list[tuple[float, PositionNed, float, datetime]] = field(default_factory=list)
    others: dict[str, list[tuple[float, PositionNed, float, datetime]]] = field(
        default_factory=dict
    )

    def set_mode(self, mode: RobotMode) -> None:
        self.modes.append(mode)

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
        of_channel = self.samples if variable in PLANNED else self.others.setdefault(variable, [])
        of_channel.append((value, position_ned, position_std_m, measured_at))
        return len(self.samples) + sum(map(len, self.others.values())) - 1

    def report_plan(
        self, state: OnboardPlanState, *, leg: int = 0, energy_used: float = 0.0, reason: str = ""
    ) -> None:
        self.plans.append((state, leg, energy_used, reason))

    def begin_next_plan(self) -> None:
        pass


class Life:
    """One robot and its notebook; ``track`` has a row per step: time, estimate, std, truth."""

    def __init__(self, definition: RobotDefinition = MINI_1, seed: int = 0) -> None:
        self.robot = SimulatedRobot(definition, seed, EPOCH)
        self.notebook = Notebook()
        self._rows: list[tuple[float, ...]] = []
        self.live(2.0)

    @property
    def executive(self):
        return self.robot.program.executive

    @property
    def estimate(self):
        return self.robot.program.estimate

    @property
    def pitch_held_rad(self):
        """The pitch that the controller holds in this step; None while none does."""
        return self.executive._flight.pilot.wanted_pitch_rad  # pyright: ignore[reportPrivateUsage]

    @property
    def track(self) -> np.ndarray:
        return np.array(self._rows)

    def live(self, seconds: float) -> None:
        self.live_until(lambda: False, seconds)

    def live_until(self, holds: Callable[[], bool], longest_s: float) -> bool:
        """Step until something holds; tell whether it did in time."""
        program = self.robot.program
        end_s = program.time_s + longest_s
        while program.time_s < end_s - 1e-6:
            self.robot.step(self.notebook)
            estimate = program.estimate
            self._rows.append(
                (
                    program.time_s,
                    *estimate.position_ned,
                    estimate.position_std_m,
                    *self.robot.body.plant.position_ned,
                )
            )
            if holds():
                return True
        return False

    def start(self, mission: Mission) -> CommandOutcome:
        self.robot.program.take_plan(mission)
        return self.robot.program.obey(CommandKind.START, mission.sha256()[:12])

    def fly(self, mission: Mission, longest_s: float = 5000.0) -> np.ndarray:
        """Fly a mission to its end; return the track of it."""
        before = len(self._rows)
        assert self.start(mission) is CommandOutcome.DONE
        running = OnboardPlanState.RUNNING
        assert self.live_until(lambda: self.executive.plan_state is not running, longest_s)
        return self.track[before:]


def mission(
    *legs: Leg,
    sample_period_s: float = 2.0,
    max_uncertainty_m: float = 10.0,
    timeout_s: float = 5000.0,
    trim: tuple[float, float] = (0.0, 0.0),
) -> Mission:
    """Return legs with settings; ``trim`` is net buoyancy kg and mass position m."""
    north, east, _ = legs[0].start_ned
    return Mission.from_legs(
        MissionSettings(sample_period_s, max_uncertainty_m, timeout_s, north, east, *trim), legs
    )


def vee(
    start: tuple[float, float] = (0.5, 0.5),
    heading_rad: float = 0.4,
    depth_m: float = 0.5,
    angle_rad: float = math.radians(47.0),
    config: PlannerConfig = TANK_PLANNER,
) -> tuple[Leg, Leg]:
    """Two glides: down and up again along one heading."""
    reach = depth_m / math.tan(angle_rad)
    ahead = (math.cos(heading_rad), math.sin(heading_rad))
    middle = (start[0] + reach * ahead[0], start[1] + reach * ahead[1], depth_m)
    end = (start[0] + 2.0 * reach * ahead[0], start[1] + 2.0 * reach * ahead[1], 0.0)
    return (
        primitive.glide(config, (*start, 0.0), middle),
        primitive.glide(config, middle, end),
    )


def horizontal(a: Sequence[float], b: Sequence[float]) -> float:
    return math.hypot(a[0] - b[0], a[1] - b[1])


def two_dives() -> tuple[Leg, ...]:
    """Out and back again."""
    out = vee()
    return (*out, *vee(out[-1].end_ned[:2], 3.4))
