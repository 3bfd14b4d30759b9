"""The Micro-Modem's driver against the emulated modem on a pseudo-terminal."""

import asyncio
import contextlib
from contextlib import asynccontextmanager
from random import Random

import pytest

from robot_link.acoustic.config import AcousticConfig
from robot_link.acoustic.micromodem import open_modem
from robot_link.acoustic.modem_line import ModemTiming
from robot_link.clock import SystemClock
from simulator.acoustic_modem import AcousticConditions, AcousticModem, AcousticNode
from tests.robot_link.test_acoustic_modem import GRACE, MINI, answered, met, scaled_clock


@asynccontextmanager
async def water(tmp_path, conditions, nodes=None, robots=None):
    """The station's modem in emulated water that is 20 times as fast; mini-1 is out of reach."""
    clock = scaled_clock(20.0)
    nodes = nodes or {2: AcousticNode(lambda: (300.0, 400.0, 0.0)), 3: AcousticNode(lambda: None)}
    emulated = AcousticModem(lambda: (0.0, 0.0, 0.0), nodes, Random(2), conditions, clock)
    line = tmp_path / "modem"
    links = {
        robot: f"micromodem://{line}?us=1&peer={peer}"
        for peer, robot in (robots or {2: GRACE}).items()
    }
    config = AcousticConfig(range_max_m=75.0, turnaround_s=0.0)
    async with emulated.pty(line):
        modem = open_modem(links, clock, config, ModemTiming(echo_s=20.0, reopen_s=0.02))
        running = asyncio.create_task(modem.run())
        try:
            await met(lambda: modem.is_ready)
            yield modem, emulated
        finally:
            running.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await running


@pytest.mark.parametrize("replier_first", [False, True])
async def test_ranges_to_an_emulated_modem_are_right(tmp_path, replier_first):
    conditions = AcousticConditions(replier_first=replier_first)
    async with water(tmp_path, conditions, robots={2: GRACE, 3: MINI}) as (modem, emulated):
        assert emulated.settings["SRC"] == 1
        ranges = [(await answered(modem)).range_m for _ in range(5)]
        assert ranges == pytest.approx([500.0] * 5, abs=12.0)
        if replier_first:
            assert (await modem.ping(3)).reason.startswith("no answer")


async def test_an_emulated_modem_that_reboots_gets_its_address_back(tmp_path):
    async with water(tmp_path, AcousticConditions()) as (modem, emulated):
        emulated.reboot()
        assert emulated.settings["SRC"] == 0
        await met(lambda: emulated.settings["SRC"] == 1 and modem.is_ready)
        assert (await answered(modem)).is_valid
        await met(lambda: emulated.is_clock_set)


async def test_a_line_that_is_not_there_yet_is_opened_once_it_is(tmp_path):
    clock = scaled_clock(20.0)
    line = tmp_path / "modem"
    links = {GRACE: f"micromodem://{line}?us=1&peer=2"}
    modem = open_modem(links, clock, timing=ModemTiming(echo_s=20.0, reopen_s=0.02))
    events = modem.events()
    running = asyncio.create_task(modem.run())
    try:
        assert not (await anext(events)).is_open
        emulated = AcousticModem(lambda: None, {}, Random(2), AcousticConditions(), clock)
        async with emulated.pty(line):
            assert (await anext(events)).is_open
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


def test_links_that_do_not_name_one_modem_are_refused():
    clock = SystemClock()
    one, two = "micromodem:///dev/ttyS0?us=1&peer=2", "micromodem:///dev/ttyS1?us=1&peer=3"
    for links in ({}, {GRACE: one, MINI: two}, {GRACE: one, MINI: one}):
        with pytest.raises(ValueError, match="modem"):
            open_modem(links, clock)
