"""A robot with two radios: which one is taken, what is shown of each, and the operator's plug."""

import asyncio
import random
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest

from onboard.link.plan_store import MemoryPlanStore
from onboard.link.robot_link import RobotLink
from robot_link.clock import SystemClock
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    LinkReport,
    LinkState,
    RawFrame,
)
from robot_link.sample_log import MemorySampleLog
from robot_link.station.link import RadioPath, RobotEndpoint, StationLink
from robot_link.transport import xbee
from robot_link.transport.datagram import Address
from robot_link.transport.opening import open_transport
from robot_link.transport.xbee import XBeeTiming
from simulator.xbee_network import XBeeNetwork
from tests.robot_link.rig import (
    CALM,
    HASTE,
    MINI,
    STATION,
    SYSTEMS,
    Heard,
    Program,
    pass_time,
    running,
    settled,
    soon,
    until,
)

NEAR, FAR = Address(0x0013A200_41F00001), Address(0x0013A200_41F00011)


@dataclass
class TwoRoads:
    """A robot that is heard in two networks, with one program behind both radios."""

    uris: tuple[str, str]
    station: StationLink
    heard: Heard
    program: Program
    reach: list[bool]

    def report(self, road: int) -> LinkReport:
        return self.station.link_reports(MINI)[road]

    def states(self) -> list[LinkState]:
        return [report.state for report in self.station.link_reports(MINI)]

    async def fall_silent(self, road: int, monkeypatch: pytest.MonkeyPatch) -> None:
        """Put the robot out of one network's reach, for long."""
        self.reach[road] = False
        await settled(lambda: self.report(road).frames_received)
        pass_time(monkeypatch, 100.0)

    async def tell(self, number: int, kind: CommandKind = CommandKind.HOLD) -> CommandReport:
        """Send a command and return its last report."""
        self.station.send_command(MINI, kind, CommandNumber(number), soon())
        await until(lambda: any(one.number == number and _is_last(one) for one in self.commands()))
        return next(one for one in self.commands() if one.number == number and _is_last(one))

    def commands(self) -> list[CommandReport]:
        return self.heard.of(CommandReport)


def _is_last(report: CommandReport) -> bool:
    return report.level in (CommandLevel.APPLIED, CommandLevel.REFUSED, CommandLevel.EXPIRED)


@asynccontextmanager
async def two_roads(folder: Path, second_address: Address | None = None) -> AsyncIterator[TwoRoads]:
    program, heard, reach = Program(), Heard(), [True, True]
    uris = (f"xbee://{folder}/near", f"xbee://{folder}/far")
    async with AsyncExitStack() as stack:
        for road, (uri, address) in enumerate(zip(uris, (NEAR, FAR), strict=True)):
            air = XBeeNetwork(random.Random(road), CALM, lambda _a, _b, road=road: reach[road])
            await stack.enter_async_context(air.pty(STATION, Path(uri.removeprefix("xbee://"))))
            link = RobotLink(
                SYSTEMS[MINI],
                air.robot_radio(address),
                SystemClock(),
                program,
                log=MemorySampleLog(77),
                plans=MemoryPlanStore(),
                timing=HASTE,
            )
            await stack.enter_async_context(running(link.run))
        paths = (RadioPath(uris[0]), RadioPath(uris[1], second_address))
        station = StationLink(
            {uri: open_transport(uri) for uri in uris},
            {MINI: RobotEndpoint(SYSTEMS[MINI], paths)},
            SystemClock(),
            heard,
            HASTE,
        )
        await stack.enter_async_context(running(station.run))
        yield TwoRoads(uris, station, heard, program, reach)


async def test_each_road_has_a_report_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    async with two_roads(tmp_path) as it:
        await until(lambda: it.states() == [LinkState.LIVE, LinkState.LIVE])
        near, far = it.station.link_reports(MINI)
        assert (near.uri, far.uri) == it.uris
        assert (near.radio, far.radio) == (f"{NEAR:016X}", f"{FAR:016X}")
        assert near.is_enabled
        assert {report.uri for report in it.heard.of(LinkReport)} == set(it.uris)
        await it.fall_silent(0, monkeypatch)
        await until(lambda: it.states() == [LinkState.STALE, LinkState.LIVE])
        assert it.station.link_report(MINI).uri == it.uris[1], "the live one is the best"


async def test_the_preferred_radio_is_taken_while_it_is_live_and_the_other_then(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    # a radio that is late with its word has not failed
    monkeypatch.setattr(xbee, "XBeeTiming", partial(XBeeTiming, status_timeout_s=60.0))
    async with two_roads(tmp_path) as it:
        await until(lambda: it.states() == [LinkState.LIVE, LinkState.LIVE])
        assert it.station.link_report(MINI).uri == it.uris[0]
        assert (await it.tell(1)).level is CommandLevel.APPLIED
        await it.fall_silent(0, monkeypatch)
        await until(lambda: it.states() == [LinkState.STALE, LinkState.LIVE])
        assert (await it.tell(2)).level is CommandLevel.APPLIED
        assert len(it.program.obeyed) == 2


async def test_a_radio_that_does_not_get_through_gives_way_to_the_other_at_once(tmp_path: Path):
    """The first still counts as live: it fell silent less than the limit ago."""
    async with two_roads(tmp_path) as it:
        await until(lambda: it.states() == [LinkState.LIVE, LinkState.LIVE])
        it.reach[0] = False
        assert it.states()[0] is LinkState.LIVE
        assert (await it.tell(1)).level is CommandLevel.APPLIED


async def test_a_pulled_plug_is_shown_and_the_other_radio_taken(tmp_path: Path):
    async with two_roads(tmp_path) as it:
        await until(lambda: it.states() == [LinkState.LIVE, LinkState.LIVE])
        it.station.set_enabled(it.uris[0], False)
        await until(lambda: it.states()[0] is LinkState.DISABLED)
        assert not it.report(0).is_enabled
        told = it.heard.of(LinkReport)
        assert any(one.state is LinkState.DISABLED and one.uri == it.uris[0] for one in told)
        assert (await it.tell(1)).level is CommandLevel.APPLIED
        it.station.set_enabled(it.uris[1], False)
        await until(lambda: it.states() == [LinkState.DISABLED, LinkState.DISABLED])
        await until(lambda: not any(port.max_payload for port in it.station._transports.values()))
        frames = len(it.heard.of(RawFrame))
        await asyncio.sleep(1.0)
        under_way = 2
        assert len(it.heard.of(RawFrame)) <= frames + under_way, "all is quiet"
        it.station.set_enabled(it.uris[0], True)
        await until(lambda: it.states()[0] is LinkState.LIVE)
        with pytest.raises(KeyError):
            it.station.set_enabled("udp://127.0.0.1:1", False)


async def test_surface_is_said_on_every_road_at_once(tmp_path: Path):
    """Each of this robot's two radios has a link of its own, so that it obeys once by each."""
    async with two_roads(tmp_path) as it:
        await until(lambda: it.states() == [LinkState.LIVE, LinkState.LIVE])
        it.station.send_command(MINI, CommandKind.SURFACE, CommandNumber(1), soon())
        await until(lambda: len(it.program.obeyed) == 2)
        assert {kind for kind, _ in it.program.obeyed} == {CommandKind.SURFACE}


async def test_a_foreign_radio_on_one_road_is_dropped_and_counted_there(tmp_path: Path):
    async with two_roads(tmp_path, second_address=Address(5)) as it:
        await until(lambda: it.states()[0] is LinkState.LIVE)
        await until(lambda: it.report(1).frames_bad > 3)
        assert it.states()[1] is LinkState.NEVER_HEARD
        assert it.report(1).frames_received == 0
        assert it.report(1).radio == f"{5:016X}", "the registered radio stays bound"
        assert it.report(0).frames_bad == 0


async def test_a_robot_without_any_radio_is_refused():
    with pytest.raises(ValueError, match="has no radio"):
        StationLink(
            {},
            {MINI: RobotEndpoint(SYSTEMS[MINI], ())},
            SystemClock(),
            lambda _: None,
        )
