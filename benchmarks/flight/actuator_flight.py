"""Tank robots with slow, late actuators that nobody is told of, flown by their own program.

Drawn when this runs: the rate of the sliding mass, evenly in its logarithm from an eighth to the
nominal one; its delay, evenly from 0 to 1 s; the robot's sensors, their biases and its water. The
error is that of the true pitch, after the first dive (two legs), against the pitch that the robot
holds; the robot said so wherever that changes more slowly than planned. Beside it stands the error
against the pitch of the leg's own glide, which no robot takes on at once.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.flight.robust_control import SWING_BAR_RAD, UNTOLD_SHARE, share_interval
from robot_link.messages import OnboardPlanState
from simulator.fault import RobotFaults
from simulator.fleet import MINI_1
from tests.simulator.flight import Life, mission, vee

DRAWS = 40
DIVES = 4
STUCK_DRAWS = 15
NOMINAL = 3
"""Robots with nothing wrong, for comparison."""
LONGEST_S = 6000.0
_LEG_AHEAD = 3.5


def measure() -> list[dict[str, Any]]:
    """Fly robots with drawn actuators, and robots whose actuators stick."""
    seed = int(np.random.default_rng().integers(2**32))
    return [*slow_actuators(seed), *stuck_actuators(seed)]


@dataclass(frozen=True, slots=True)
class _Flown:
    """One robot's flight."""

    held_rms_rad: float
    """Against the pitch that the robot holds."""
    asked_rms_rad: float
    """Against the pitch that the leg's glide asks for."""
    was_slowed: bool
    rate_error_octaves: float
    delay_error_s: float
    is_done: bool


def slow_actuators(seed: int, draws: int = DRAWS) -> list[dict[str, Any]]:
    """Return the shares of robots that fly smoothly and know their sliding mass.

    Args:
        seed: Decides all draws; it is told with the result.
        draws: How many robots.
    """
    flown = [_flown(np.random.default_rng([seed, n])) for n in range(draws)]
    sound = [_flown_with(RobotFaults(), seed + n) for n in range(NOMINAL)]
    held = np.array([one.held_rms_rad for one in flown])
    asked = np.array([one.asked_rms_rad for one in flown])
    smooth = int(np.count_nonzero(held <= SWING_BAR_RAD))
    low, high = share_interval(smooth, draws)
    title = "Onboard, untold mass, rate 1/8 to 1, delay 0 to 1 s"
    rate = np.abs([one.rate_error_octaves for one in flown])
    delay = np.abs([one.delay_error_s for one in flown])
    slowed = float(np.mean([one.was_slowed for one in flown]))
    done = float(np.mean([one.is_done for one in flown]))
    return [
        _row(
            f"{title}: pitch RMS <= {SWING_BAR_RAD:g} rad against the pitch held, after the first"
            f" dive, {draws} robots, seed {seed} (95 %: {low:.3f} to {high:.3f})",
            smooth / draws,
            "",
            UNTOLD_SHARE,
        ),
        _row(f"{title}: pitch RMS against the pitch held, 95 %", np.quantile(held, 0.95), "rad"),
        _row(f"{title}: pitch RMS against the leg's glide, median", np.median(asked), "rad"),
        _row(f"{title}: pitch RMS against the leg's glide, 95 %", np.quantile(asked, 0.95), "rad"),
        _row(
            "Onboard, nominal mass: pitch RMS against the pitch held",
            np.max([one.held_rms_rad for one in sound]),
            "rad",
        ),
        _row(
            "Onboard, nominal mass: pitch RMS against the leg's glide",
            np.median([one.asked_rms_rad for one in sound]),
            "rad",
        ),
        _row(f"{title}: robots that slowed their legs and said so", slowed, ""),
        _row(f"{title}: plans flown to their end", done, ""),
        _row(f"{title}: rate learned, error, 95 %", 2.0 ** np.quantile(rate, 0.95) - 1.0, ""),
        _row(f"{title}: delay learned, error, 95 %", np.quantile(delay, 0.95), "s"),
    ]


def stuck_actuators(seed: int, draws: int = STUCK_DRAWS) -> list[dict[str, Any]]:
    """Return the share of stuck actuators that are named, and of sound robots that name none."""
    generator = np.random.default_rng([seed, 10_000])
    named = 0
    for _ in range(draws):
        what = ("mass_sticks_s", "pump_sticks_s", "tail_sticks_s")[int(generator.integers(3))]
        faults = RobotFaults(**{what: float(generator.uniform(5.0, 120.0))})
        life = Life(replace(MINI_1, faults=faults), int(generator.integers(2**31)))
        life.start(mission(*_legs()))
        watch = life.executive.actuators
        life.live_until(lambda watch=watch: bool(watch.stuck), 900.0)
        names = {"mass_sticks_s": "sliding mass", "pump_sticks_s": "pump", "tail_sticks_s": "tail"}
        named += [one.value for one in watch.stuck] == [names[what]]
    low, high = share_interval(named, draws)
    return [
        _row(
            f"Onboard, an actuator that sticks is named, {draws} robots (95 %: {low:.3f} to"
            f" {high:.3f})",
            named / draws,
            "",
            UNTOLD_SHARE,
        )
    ]


def _flown(generator: np.random.Generator) -> _Flown:
    faults = RobotFaults(
        mass_rate_share=float(2.0 ** generator.uniform(-3.0, 0.0)),
        mass_delay_s=float(generator.uniform(0.0, 1.0)),
    )
    return _flown_with(faults, int(generator.integers(2**31)))


def _flown_with(faults: RobotFaults, seed: int) -> _Flown:
    life = Life(replace(MINI_1, faults=faults), seed)
    executive = life.executive
    life.start(mission(*_legs()))
    errors: list[tuple[float, float]] = []
    slowest = 1.0
    ends_s = life.robot.program.time_s + LONGEST_S
    while executive.plan_state is OnboardPlanState.RUNNING and life.robot.program.time_s < ends_s:
        life.robot.step(life.notebook)
        slowest = min(slowest, executive.gait.speed_share)
        held = life.pitch_held_rad
        if held is not None and executive.leg >= 2:
            pitch = float(life.robot.body.plant.state[4])
            errors.append((pitch - held, pitch - _asked(executive, held)))
    rms = np.sqrt(np.mean(np.array(errors) ** 2, axis=0)) if errors else np.full(2, math.inf)
    mass = executive.actuators.mass.belief
    return _Flown(
        held_rms_rad=float(rms[0]),
        asked_rms_rad=float(rms[1]),
        was_slowed=slowest < 1.0,
        rate_error_octaves=math.log2(mass.rate_share / faults.mass_rate_share),
        delay_error_s=mass.delay_s - faults.mass_delay_s,
        is_done=executive.plan_state is OnboardPlanState.DONE,
    )


def _asked(executive: Any, held_rad: float) -> float:
    """Return the pitch that the leg's own glide asks for, of which a robot tells nobody."""
    motion = getattr(executive._maneuver, "_motion", None)  # noqa: SLF001
    aim = getattr(motion, "_aim", None)
    return held_rad if aim is None else float(aim._wanted_rad)  # noqa: SLF001


def _legs() -> tuple[Any, ...]:
    legs = vee()
    for dive in range(1, DIVES):
        legs = (*legs, *vee(legs[-1].end_ned[:2], _LEG_AHEAD if dive % 2 else 0.4))
    return legs


def _row(name: str, value: float, unit: str, bar: float | None = None) -> dict[str, Any]:
    met = None if bar is None else bool(value >= bar)
    row = {"area": "control", "name": name, "value": float(value)}
    return row | {"unit": unit, "bar": bar, "met": met}


if __name__ == "__main__":
    for row in measure():
        print(row)
