"""A flight by the onboard program and the simulated robot as they are, which the kernel must match.

The readable program is the truth. It flies a few hundred seconds in one; the kernel many thousands.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.planner.plan import PositionNed
from onboard.link.robot_link import CommandOutcome
from onboard.program import PERIOD_S, OnboardProgram, Radio
from robot_link.messages import CommandKind, OnboardPlanState, RobotMode, StateReport
from robot_link.mission import Mission
from simulator.aboard import program_of
from simulator.ahead.drawn import Drawn
from simulator.ahead.state import NOISE, SENSED
from simulator.fleet import RobotDefinition
from simulator.robot import SimulatedBody

_EPOCH = datetime(2000, 1, 1, tzinfo=UTC)
_LOOK_EVERY = 500
"""Steps between two questions whether to go on."""


class NotedGenerator(np.random.Generator):
    """A generator that keeps the standard normal numbers that it drew so many at a time.

    Args:
        seed: Of its bits.
        size: How many at a time are kept.
    """

    def __init__(self, seed: list[int], size: int) -> None:
        super().__init__(np.random.PCG64(seed))
        self._size = size
        self._plain = np.random.Generator(np.random.PCG64([*seed, 1]))
        self.drawn: list[FloatArray] = []
        """What was drawn so many at a time."""

    def standard_normal(  # pyright: ignore[reportIncompatibleMethodOverride] - it is overloaded
        self,
        size: Any = None,  # noqa: ANN401 - numpy's own
        dtype: Any = np.float64,  # noqa: ANN401
        out: Any = None,  # noqa: ANN401
    ) -> Any:  # noqa: ANN401
        """Draw as numpy does; everything else comes from a generator beside."""
        if size != self._size:
            return self._plain.standard_normal(size, dtype, out)
        found = super().standard_normal(size, dtype, out)
        self.drawn.append(np.array(found))
        return found

    def spawn(self, n_children: int) -> list[np.random.Generator]:
        """Return generators beside."""
        return self._plain.spawn(n_children)


@dataclass(frozen=True, slots=True)
class Noise:
    """The standard normal numbers of a flight, as the kernel takes them."""

    first: FloatArray
    """Of the two readings before the first step, shape ``(2 + 2 SENSED,)``."""
    steps: FloatArray
    """Shape ``(n, NOISE)``."""


@dataclass(frozen=True, slots=True)
class ReadableFlight:
    """What came of a flight."""

    rows: FloatArray
    """As those of the kernel, one a step: time s, leg, whether it is on it, true NED, believed NED
    m, stated std m, charge."""
    changes: list[tuple[float, int, int, bool]]
    """Time, mode, leg and whether it is on that leg, at each change."""
    is_done: bool
    reason: str
    noise: Noise


@dataclass
class _Silence:
    """A radio that nobody hears, to which no sample waits."""

    unacknowledged_samples: int = 0

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
        pass

    def begin_next_plan(self) -> None:
        pass


@dataclass(frozen=True, slots=True)
class ReadableRobot:
    """A simulated robot whose program believes in another vehicle than it is."""

    body: SimulatedBody
    program: OnboardProgram

    def step(self, radio: Radio) -> None:
        """Let one period pass."""
        self.body.advance(PERIOD_S)
        self.program.step(radio)


def readable_robot(
    definition: RobotDefinition,
    drawn: Drawn,
    seed: int,
    randomness: tuple[np.random.Generator, ...] | None = None,
) -> ReadableRobot:
    """Return a robot as one flight has it.

    Args:
        definition: The robot and its water; its vehicle is what the onboard program believes.
        drawn: What this flight meets.
        seed: Of all that is random.
        randomness: Generators in place of the seed's, as of ``SimulatedBody``.
    """
    share, sensors = drawn.noise_share, definition.sensors
    noises = {
        name: share * getattr(sensors, name)
        for name in sensors.__dataclass_fields__
        if "_std_" in name
    }
    true = replace(
        definition,
        vehicle=drawn.vehicle,
        current_ne_m_s=drawn.current_ne_m_s,
        drift_m_sqrt_s=drawn.drift_m_sqrt_s,
        sensors=replace(sensors, **noises),
        battery=replace(definition.battery, capacity_wh=drawn.capacity_wh),
        instruments=(),
    )
    body = SimulatedBody(true, seed, water_s=-drawn.settling_s, randomness=randomness)
    body.battery.fraction = drawn.battery
    body.sensors.buoyancy_bias_kg = drawn.buoyancy_bias_kg
    body.sensors.mass_position_bias_m = drawn.mass_position_bias_m
    aboard = replace(definition, instruments=())
    return ReadableRobot(body, program_of(aboard, body, _EPOCH, current=drawn.belief))


def fly_readable(
    definition: RobotDefinition,
    mission: Mission,
    drawn: Drawn,
    seed: int,
    is_cancelled: Callable[[], bool] = lambda: False,
) -> ReadableFlight | None:
    """Fly a mission by the readable program; None if it was cancelled.

    Args:
        definition: The robot and its water.
        mission: What it flies.
        drawn: What this flight meets.
        seed: Of all that is random.
        is_cancelled: Asked now and then whether to stop.
    """
    eddies, sensors = NotedGenerator([seed, 1], 2), NotedGenerator([seed, 2], SENSED)
    randomness = (eddies, sensors, np.random.default_rng([seed, 3]))
    robot, radio = readable_robot(definition, drawn, seed, randomness), _Silence()
    program, executive = robot.program, robot.program.executive
    while program.time_s < drawn.settling_s - 1e-6:
        robot.step(radio)
    program.take_plan(mission)
    rows: list[tuple[float, ...]] = []
    changes: list[tuple[float, int, int, bool]] = []
    began_s, told = program.time_s, None
    outcome = program.obey(CommandKind.START, mission.sha256())
    if outcome is not CommandOutcome.DONE:
        reason = executive.reason or "the robot did not start"
        return ReadableFlight(np.empty((0, 11)), [], False, reason, _noise(eddies, sensors))
    while executive.plan_state is OnboardPlanState.RUNNING:
        if len(rows) % _LOOK_EVERY == 0 and is_cancelled():
            return None
        robot.step(radio)
        now = (int(executive.mode), executive.leg, executive.is_sampling)
        time_s = program.time_s - began_s
        if now != told:
            changes.append((time_s, *now))
            told = now
        estimate = program.estimate
        place = (*robot.body.plant.position_ned, *estimate.position_ned, estimate.position_std_m)
        rows.append((time_s, executive.leg, float(now[2]), *place, robot.body.battery.fraction))
    done = executive.plan_state is OnboardPlanState.DONE
    return ReadableFlight(np.array(rows), changes, done, executive.reason, _noise(eddies, sensors))


def _noise(eddies: NotedGenerator, sensors: NotedGenerator) -> Noise:
    first = np.concatenate([eddies.drawn[0], *sensors.drawn[:2]])
    steps = [np.concatenate(pair) for pair in zip(eddies.drawn[1:], sensors.drawn[2:], strict=True)]
    return Noise(first, np.array(steps).reshape(-1, NOISE))
