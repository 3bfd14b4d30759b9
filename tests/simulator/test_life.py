"""A robot of the simulation keeps up with the clock that it lives by."""

import asyncio
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest

from onboard.program import PERIOD_S
from simulator import life, process
from simulator.fleet import USUAL_ROBOTS
from simulator.settings import SimulatorSettings

BEGAN = datetime(2026, 11, 1, tzinfo=UTC)
OVERSLEPT_S = 0.004
"""What a machine adds to every sleep."""


class Being:
    time_s = 0.0

    def step(self):
        self.time_s += PERIOD_S

    def report(self):
        pass


class SlowMachine:
    """Its wall goes on while somebody sleeps, and by a little more."""

    def __init__(self, speed, late_s, sleeps):
        self.speed = speed
        self._passed_s = late_s
        self._sleeps = sleeps

    def now(self):
        return BEGAN + timedelta(seconds=self._passed_s)

    async def sleep(self, seconds):
        self._passed_s += (seconds + OVERSLEPT_S) * self.speed
        self._sleeps -= 1
        if self._sleeps == 0:
            raise asyncio.CancelledError


@pytest.mark.parametrize("late_s", [0.0, 4.9, 60.0])
@pytest.mark.parametrize("speed", [0.5, 1.0, 5.0, 20.0, 50.0])
async def test_a_robot_catches_up_what_it_missed(monkeypatch, speed, late_s):
    machine, being = SlowMachine(speed, late_s, 1000), Being()
    monkeypatch.setattr(life, "asyncio", SimpleNamespace(sleep=machine.sleep))
    with suppress(asyncio.CancelledError):
        await life.live(being, machine, BEGAN)
    behind_s = (machine.now() - BEGAN).total_seconds() - being.time_s
    assert behind_s < PERIOD_S + 2 * 0.1 * max(speed, 1.0)


async def test_what_passes_while_its_devices_are_opened_is_lived_too(monkeypatch, tmp_path):
    begun, opened, all_begun = [], [], asyncio.Event()
    true_equipped = process.equipped

    def slow(settings, definition, body, time, network, more=()):
        opened.append(time.started_at)
        return true_equipped(settings, definition, body, time, network, more)

    async def note(being, clock, began):
        begun.append(began)
        if len(begun) == len(USUAL_ROBOTS):
            all_begun.set()

    monkeypatch.setattr(process, "equipped", slow)
    monkeypatch.setattr(process, "live", note)
    now, stopped = datetime.now(UTC), asyncio.Event()
    settings = SimulatorSettings(link_folder=tmp_path, wall_anchor=now, time_anchor=now, speed=20.0)
    async with asyncio.TaskGroup() as group:
        group.create_task(process.serve(settings, stopped))
        await all_begun.wait()
        stopped.set()
    assert sorted(begun) == sorted(opened)  # lives begin in any order
