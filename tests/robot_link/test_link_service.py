"""Parameters, files and the clock of a robot through the station's link and real radio frames."""

import asyncio
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import pytest

from robot_link.clock import SystemClock
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    LinkState,
    OnboardPlanState,
    UploadReport,
)
from robot_link.service.clock_sync import ClockSource
from robot_link.service.file_store import FolderFiles
from robot_link.service.parameter_table import Parameter, ParameterTable, ParameterType
from robot_link.station.error import NoAnswerError, OutOfContactError, ServiceRefusedError
from robot_link.station.link import RobotEndpoint, StationLink
from robot_link.station.path import RadioPath
from tests.robot_link.rig import (
    GRACE,
    MINI,
    ROUGH,
    SYSTEMS,
    Heard,
    Rig,
    mission,
    rig,
    soon,
    state,
    until,
)

PARAMETERS = (
    Parameter("GAIN_PITCH", ParameterType.REAL32, 0.4, 0.0, 2.0),
    Parameter("SAT_PERIOD_S", ParameterType.INT32, 600, 30, 86400),
    *(Parameter(f"P{n}", ParameterType.INT16, n, -100, 100) for n in range(30)),
)


@dataclass(frozen=True)
class WrongClock:
    """A clock that is off."""

    offset: timedelta
    speed: float = 1.0

    def now(self) -> datetime:
        return SystemClock().now() + self.offset


async def live(station: StationLink, robot=MINI) -> None:
    await until(lambda: station.link_report(robot).state is LinkState.LIVE)


def is_compared(station: StationLink) -> bool:
    offset = station.services(MINI).clock.offset
    return offset is not None and offset.source is ClockSource.TIMESYNC


async def test_parameters_and_logs_cross_a_bad_radio(tmp_path: Path):
    logs = tmp_path / "logs"
    logs.mkdir()
    content = bytes(n * n % 251 for n in range(3000))
    (logs / "dive.bin").write_bytes(content)
    table = ParameterTable(PARAMETERS)
    async with (
        rig(tmp_path, replace(ROUGH, loss=0.2), parameters=table, files=FolderFiles(logs)) as it,
        it.station() as (station, _),
    ):
        await live(station)
        assert await station.read_parameters(MINI) == table.all()
        written = await station.write_parameter(MINI, "SAT_PERIOD_S", 1200)
        assert written == table.read("SAT_PERIOD_S")
        with pytest.raises(ServiceRefusedError, match=r"limits|still holds"):
            await station.write_parameter(MINI, "SAT_PERIOD_S", 5)
        (entry,) = await station.list_files(MINI)
        assert (entry.name, entry.size) == ("dive.bin", len(content))
        assert await station.download_file(MINI, "/dive.bin") == content


async def test_a_robot_out_of_contact_is_not_asked(tmp_path: Path):
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / "dive.bin").write_bytes(bytes(6000))
    async with rig(tmp_path, files=FolderFiles(logs)) as it, it.station() as (station, _):
        it.reachable.clear()
        with pytest.raises(OutOfContactError, match="mini-1 is not in radio contact"):
            await station.read_parameters(MINI)
        it.reachable.add(MINI)
        await live(station)

        def dive(received: int, _size: int) -> None:
            if received > 1000:
                it.reachable.clear()

        came = bytearray()
        with pytest.raises(NoAnswerError):
            await station.download_file(MINI, "/dive.bin", content=came, report=dive)
        it.reachable.add(MINI)
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        assert 1000 < len(came) < 6000
        assert await station.download_file(MINI, "/dive.bin", content=came) == bytes(6000)


async def test_a_clock_that_is_off_by_years_is_told_of_with_the_link(tmp_path: Path):
    clock = WrongClock(timedelta(days=-9 * 365))
    async with rig(tmp_path, clock=clock) as it, it.station() as (station, _):
        await until(lambda: station.services(MINI).clock.offset is not None)
        await until(lambda: station.link_report(MINI).clock_offset_s is not None)
        offset = station.services(MINI).clock.offset
        assert offset is not None
        assert offset.source is ClockSource.TIMESYNC
        assert offset.is_wrong
        assert offset.offset_s == pytest.approx(-9 * 365 * 86400.0, abs=5.0)
        assert station.link_report(MINI).trouble == "its clock is 9 years behind"


async def test_a_clock_that_is_right_is_no_trouble(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, _):
        it.robots[MINI].link.report_state(state(SystemClock().now()))
        await until(lambda: is_compared(station))
        assert station.link_report(MINI).trouble == ""
        assert abs(station.link_report(MINI).clock_offset_s or 0.0) < 5.0


async def test_robots_come_and_go_while_the_others_are_served(tmp_path: Path):
    async with rig(tmp_path, robots=(MINI, GRACE)) as it, it.station() as (station, heard):
        transports = dict(station._transports)
        both = {robot: ends(it, robot) for robot in (MINI, GRACE)}
        station.set_robots({MINI: both[MINI]}, transports)
        await live(station)
        counted = station.link_report(MINI).frames_received
        with pytest.raises(KeyError):
            station.link_report(GRACE)
        station.set_robots(both, {it.uri: object()})  # type: ignore[dict-item]  - stays untouched
        await live(station, GRACE)
        assert station.link_report(MINI).frames_received >= counted
        station.send_command(GRACE, CommandKind.HOLD, CommandNumber(5), soon())
        await until(lambda: applied(heard, 5))
        station.set_robots({GRACE: both[GRACE]}, transports)
        with pytest.raises(KeyError):
            station.send_command(MINI, CommandKind.HOLD, CommandNumber(6), soon())
        station.send_command(GRACE, CommandKind.HOLD, CommandNumber(7), soon())
        await until(lambda: applied(heard, 7))


async def test_an_upload_to_a_robot_that_is_taken_away_fails_with_a_sentence(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        it.reachable.clear()
        upload = asyncio.create_task(station.upload(MINI, mission()))
        await until(lambda: heard.of(UploadReport))
        station.set_robots({}, {})
        report = await upload
        assert report.state is OnboardPlanState.FAILED
        assert report.reason == "the robot's links or its key were changed"


def ends(it: Rig, robot) -> RobotEndpoint:
    return RobotEndpoint(SYSTEMS[robot], (RadioPath(it.uri),))


def applied(heard: Heard, number: int) -> bool:
    levels = [r.level for r in heard.of(CommandReport) if r.number == number]
    return CommandLevel.APPLIED in levels
