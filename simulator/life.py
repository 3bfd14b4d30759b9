"""Simulated robots live by the shared clock, in steps, and sleep in between."""

import asyncio
from datetime import datetime
from typing import Protocol

from onboard.computer import Computer
from onboard.node.body import BodyNode
from onboard.program import PERIOD_S
from robot_link.clock import Clock
from simulator.robot import SimulatedBody, SimulatedRobot

_STATE_INTERVAL_S = 0.1
"""Wall time between two state reports of a robot whose clock is not fast."""
_STATE_GAP_S = 1.0
"""Time between two state reports by the robot's own clock, at most: a record of a flight that
leaves out more is of no use to learn a vehicle from."""
_SLEEP_MIN_S = 0.02
"""The radio needs about as long to take a report before the next one replaces it."""
_STEPS_AT_ONCE = 50
"""Steps of one robot before the event loop gets its turn: some ten milliseconds."""
_CATCHING_UP_SLEEP_S = 0.001


class Living(Protocol):
    """Something that lives in steps of ``PERIOD_S``."""

    @property
    def time_s(self) -> float:
        """Seconds that it has lived."""
        ...

    def step(self) -> None:
        """Live one step."""
        ...

    def report(self) -> None:
        """Tell the station where it is, if it is able to."""
        ...


class WholeRobot:
    """A robot whose onboard program runs in this process."""

    def __init__(self, robot: SimulatedRobot, computer: Computer) -> None:
        self._robot = robot
        self._computer = computer

    @property
    def time_s(self) -> float:
        """Seconds that it has lived."""
        return self._robot.program.time_s

    def step(self) -> None:
        """Live one step."""
        self._robot.body.advance(PERIOD_S)
        self._computer.step()

    def report(self) -> None:
        """Tell the station where it believes to be."""
        self._computer.report_state()


class BareBody:
    """A robot whose onboard program runs elsewhere and talks to its nodes."""

    def __init__(self, body: SimulatedBody, node: BodyNode) -> None:
        self._body = body
        self._node = node

    @property
    def time_s(self) -> float:
        """Seconds that it has lived."""
        return self._body.plant.time_s

    def step(self) -> None:
        """Live one step, and publish what the sensors say."""
        self._body.advance(PERIOD_S)
        self._node.publish()

    def report(self) -> None:
        """Do nothing: its program reports."""


async def live(being: Living, clock: Clock, began: datetime) -> None:
    """Let it live by the clock until cancelled, and catch up whatever it missed.

    Args:
        being: What lives.
        clock: The time that it lives by.
        began: When it was switched on: what it tells the time by counts from then, so that it has
            to live what passed while its devices were opened.
    """
    at_speed_s = max(_STATE_GAP_S, 2.0 * _SLEEP_MIN_S * clock.speed)
    interval_s = min(_STATE_INTERVAL_S * clock.speed, at_speed_s)
    reported_s = being.time_s

    def lag_s() -> float:
        return (clock.now() - began).total_seconds() - being.time_s

    while True:
        steps = int(lag_s() / PERIOD_S)
        is_late = steps > _STEPS_AT_ONCE
        due_s = reported_s + (at_speed_s if is_late else interval_s) - 0.5 * PERIOD_S
        has_reported = False
        for _ in range(min(steps, _STEPS_AT_ONCE)):
            being.step()
            if being.time_s >= due_s:
                reported_s = being.time_s
                being.report()
                has_reported = True
                break
        if is_late:
            await asyncio.sleep(_SLEEP_MIN_S if has_reported else _CATCHING_UP_SLEEP_S)
        else:
            await asyncio.sleep(max((PERIOD_S - lag_s()) / clock.speed, _SLEEP_MIN_S))
