"""The clock of the machine that the station runs on."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from server.base.clock_file import start_clock
from server.base.foundation import Foundation
from server.watch.station_clock import (
    LATELY_S,
    PERIOD_S,
    ROBOTS,
    SYNC,
    UNSYNCHRONISED_S,
    KernelClock,
    StationClock,
    kernel_clock,
    wall_and_steady_s,
)
from tests.server.conftest import StationClient, until
from tests.server.station_app import running
from tests.server.station_parts import OpenStation

START_S = 1_800_000_000.0


@dataclass
class Machine:
    """A machine whose clocks go as a test says."""

    wall_s: float = START_S
    steady_s: float = 100.0
    kernel: KernelClock | None = None

    def go(self, length_s: float, *, jump_s: float = 0.0) -> None:
        self.steady_s += length_s
        self.wall_s += length_s + jump_s


def watch_of(foundation: Foundation, machine: Machine) -> StationClock:
    """Return the station's watch, on a machine whose clocks go as the test says."""
    clock = foundation.services.get(StationClock)
    clock._read, clock._ask = lambda: (machine.wall_s, machine.steady_s), lambda: machine.kernel
    return clock


@pytest.mark.parametrize("jump_s", [37.0, -37.0, 1.5])
async def test_a_jump_is_told_for_ten_minutes_with_its_size(tmp_path: Path, jump_s: float):
    async with running(tmp_path) as app:
        machine = Machine()
        clock = watch_of(app.state.foundation, machine)
        for jump in (0.0, 0.0, jump_s, 0.0, 0.0):
            machine.go(PERIOD_S, jump_s=jump)
            await clock.look()
        assert clock.newest_jump_s == pytest.approx(jump_s)
        assert clock.jump_lately_s == pytest.approx(abs(jump_s))
        machine.go(LATELY_S)
        await clock.look()
        assert clock.jump_lately_s == 0.0
        assert clock.newest_jump_s == pytest.approx(jump_s)


async def test_a_jump_is_one_alarm_by_the_station_s_rule(
    client: StationClient, station: OpenStation
):
    machine = Machine()
    clock = watch_of(station.foundation, machine)
    clock._before = None
    for jump_s in (0.0, 0.0, -37.0):
        machine.go(PERIOD_S, jump_s=jump_s)
        await clock.look()

    async def told() -> list[dict[str, Any]]:
        alarms = (await client.get("/api/alarms")).json()["alarms"]
        return [one for one in alarms if "jumped" in one["text"]]

    (alarm,) = await until(told)
    assert "jumped by 37" in alarm["text"]
    assert clock.jump_lately_s == 37.0


async def test_a_clock_that_is_moved_slowly_or_a_machine_that_sleeps_is_no_alarm(tmp_path: Path):
    async with running(tmp_path) as app:
        machine = Machine()
        clock = watch_of(app.state.foundation, machine)
        for length_s in (PERIOD_S, 3600.0, PERIOD_S, PERIOD_S):
            machine.go(length_s, jump_s=5e-4 * min(length_s, 60.0))
            await clock.look()
        assert clock.jump_lately_s == 0.0
        assert app.state.foundation.alarms.open == []


async def test_a_clock_without_synchronisation_is_told_after_a_quarter_of_an_hour(tmp_path: Path):
    async with running(tmp_path) as app:
        foundation: Foundation = app.state.foundation
        machine = Machine(kernel=KernelClock(is_synchronised=False, max_error_s=16.0))
        clock = watch_of(foundation, machine)
        await clock.look()
        machine.go(UNSYNCHRONISED_S - 1.0)
        await clock.look()
        assert foundation.alarms.standing(SYNC, None) is None
        machine.go(1.0)
        await clock.look()
        assert foundation.alarms.standing(SYNC, None) is not None
        assert "not synchronised" in clock.text
        machine.kernel = KernelClock(is_synchronised=True, max_error_s=0.01)
        await clock.look()
        assert foundation.alarms.standing(SYNC, None) is None


async def test_the_clock_of_a_demo_is_no_alarm(tmp_path: Path):
    start_clock(tmp_path / "clock.json", 20.0)
    async with running(tmp_path, clock_file=tmp_path / "clock.json", simulation=True) as app:
        machine = Machine(kernel=KernelClock(is_synchronised=False, max_error_s=16.0))
        clock = watch_of(app.state.foundation, machine)
        clock.add_witness(lambda: {"mini-1": 700.0, "grace-1": 700.0})
        for _ in range(3):
            machine.go(UNSYNCHRONISED_S)
            await clock.look()
        assert app.state.foundation.alarms.open == []


@pytest.mark.parametrize(
    ("offsets_s", "words"),
    [
        ({"mini-1": 37.0, "grace-1": 38.0}, "about 40 s behind the clocks of 2 robots"),
        ({"mini-1": -61.0, "grace-1": -60.0, "grace-2": 2.0}, "about 60 s ahead of"),
        ({"mini-1": 37.0}, None),
        ({"mini-1": 37.0, "grace-1": 0.1}, None),
        ({"mini-1": 0.4, "grace-1": -0.3}, None),
    ],
)
async def test_robots_that_agree_with_each_other_accuse_the_station(
    tmp_path: Path, offsets_s: dict[str, float], words: str | None
):
    async with running(tmp_path) as app:
        clock = watch_of(app.state.foundation, Machine())
        clock.add_witness(lambda: offsets_s)
        await clock.look()
        alarm = app.state.foundation.alarms.standing(ROBOTS, None)
        assert (alarm is None) == (words is None)
        assert alarm is None or str(words) in alarm.text


def test_this_machine_tells_its_clocks():
    first, second = wall_and_steady_s(), wall_and_steady_s()
    assert second[1] >= first[1]
    told = kernel_clock()
    assert told is None or told.max_error_s >= 0.0


async def test_health_tells_clock_disk_loop_and_workers(client: StationClient):
    health = (await client.get("/api/health")).json()
    assert health["ready"]
    assert health["disk"]["size_bytes"] >= health["disk"]["free_bytes"] > 0
    assert health["event_loop_lag_s"] >= 0.0
    assert set(health["workers"]) == {"busy", "idle", "queued"}
    assert health["machine_clock"]["last_jump_s"] == 0.0
    assert (health["status"] == "ok") == (health["reasons"] == [])
