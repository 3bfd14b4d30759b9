"""What robots keep on board: parameters and files, over a radio that may fail."""

import asyncio
from datetime import UTC, datetime

import pytest

from robot_link.service.file_store import FileEntry
from robot_link.service.parameter_table import ParameterType, ParameterValue
from robot_link.station.error import (
    NoAnswerError,
    OutOfContactError,
    ServiceRefusedError,
)
from server.base.problem import Problem
from server.link.parameters import Parameters
from server.link.robot_logs import PartialFile, RobotLogs
from tests.server.conftest import MINI, until

LOG = b"depth,pitch\n" * 400


class Robot:
    """Parameters and files, behind a radio that breaks off where it is told to."""

    def __init__(self):
        self.values = {"PITCH_GAIN": 0.5, "SAMPLES": 4.0}
        self.types = {"PITCH_GAIN": ParameterType.REAL32, "SAMPLES": ParameterType.INT32}
        self.fault = None
        self.breaks_at = None
        self.offsets = []
        self.gate = asyncio.Event()
        self.gate.set()

    def value(self, name):
        place = list(self.values).index(name)
        return ParameterValue(name, self.values[name], self.types[name], place)

    async def read_parameters(self, robot):
        assert robot == MINI
        await self.gate.wait()
        self.complain()
        return tuple(self.value(name) for name in self.values)

    async def write_parameter(self, robot, name, value):
        assert robot == MINI
        self.complain()
        self.values[name] = value
        return self.value(name)

    async def list_files(self, robot, path="/"):
        assert robot == MINI
        self.complain()
        if path == "/":
            return (FileEntry("logs", 0, is_folder=True), FileEntry("readme.txt", 20))
        return (FileEntry("dive-1.csv", len(LOG)),)

    async def download_file(self, robot, path, *, content, report):
        assert (robot, path) == (MINI, "/logs/dive-1.csv")
        self.offsets.append(len(content))
        while len(content) < len(LOG):
            if self.breaks_at is not None and len(content) >= self.breaks_at:
                await self.gate.wait()
                raise NoAnswerError("the robot fell silent")
            content += LOG[len(content) : len(content) + 200]
            report(len(content), len(LOG))
        return bytes(content)

    def complain(self):
        if self.fault is not None:
            raise self.fault


@pytest.fixture
def robot():
    return Robot()


@pytest.fixture
def parameters(station, robot):
    return Parameters(station.foundation, station.fleet, robot)


@pytest.fixture
def logs(station, robot):
    return RobotLogs(station.foundation, station.fleet, robot)


async def ended(station, job):
    async def done():
        record = await station.foundation.jobs.get(job)
        return record if record.ended_at is not None else None

    return await until(done)


async def test_parameters_are_read_and_stay_ashore(station, parameters):
    assert (await parameters.view(MINI)).read_at is None
    job = await ended(station, await parameters.read(MINI, by="Kim"))
    assert (job.state, job.result) == ("done", {"parameters": 2, "described": 0})
    view = await parameters.view(MINI)
    assert [(one.name, one.value, one.is_integer) for one in view.parameters] == [
        ("PITCH_GAIN", 0.5, False),
        ("SAMPLES", 4.0, True),
    ]
    assert view.read_at <= datetime.now(UTC)


async def test_two_who_ask_at_once_share_one_reading(station, parameters, robot):
    robot.gate.clear()
    first = await parameters.read(MINI, by="Kim")
    assert await parameters.read(MINI, by="Ada") == first
    robot.gate.set()
    await ended(station, first)
    assert await parameters.read(MINI, by="Ada") != first


async def test_a_written_parameter_is_what_the_robot_says_afterwards(station, parameters):
    await ended(station, await parameters.read(MINI, by="Kim"))
    kept = await parameters.write(MINI, "PITCH_GAIN", 0.75, by="Kim")
    assert (kept.value, kept.pending) == (0.75, False)
    assert (await parameters.view(MINI)).parameters[0].value == 0.75


@pytest.mark.parametrize(
    ("name", "value", "status", "words"),
    [
        ("SAMPLES", 2.5, 422, "whole number"),
        ("SAMPLES", 1e12, 422, "between"),
        ("PITCH_GAIN", float("nan"), 422, "finite"),
        ("NOBODY", 1.0, 404, "NOBODY"),
    ],
)
async def test_a_wrong_value_is_refused_before_a_byte_leaves(
    station, parameters, robot, name, value, status, words
):
    await ended(station, await parameters.read(MINI, by="Kim"))
    before = dict(robot.values)
    with pytest.raises(Problem, match=words) as refused:
        await parameters.write(MINI, name, value, by="Kim")
    assert refused.value.status == status
    assert robot.values == before


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (NoAnswerError("the robot did not answer"), "is not known"),
        (OutOfContactError("mini-1 is not in radio contact"), r"^Mini-1 is not in .* contact\.$"),
        (ServiceRefusedError("PITCH_GAIN: read only"), "read only"),
    ],
)
async def test_a_failed_writing_says_what_is_known(station, parameters, robot, fault, words):
    await ended(station, await parameters.read(MINI, by="Kim"))
    robot.fault = fault
    with pytest.raises(Problem, match=words) as refused:
        await parameters.write(MINI, "PITCH_GAIN", 0.9, by="Kim")
    assert refused.value.status == 409
    view = await parameters.view(MINI)
    assert (view.parameters[0].value, view.parameters[0].pending) == (0.5, False)


async def test_a_silent_robot_ends_the_reading_with_a_sentence(station, parameters, robot):
    robot.fault = NoAnswerError("the robot did not answer")
    job = await ended(station, await parameters.read(MINI, by="Kim"))
    assert (job.state, job.message) == ("failed", "The robot did not answer.")


async def test_a_file_that_broke_off_is_fetched_from_there(station, logs, robot):
    await ended(station, await logs.read(MINI, by="Kim"))
    listed = {one.path: one for one in (await logs.view(MINI)).logs}
    assert set(listed) == {"/logs/dive-1.csv", "/readme.txt"}
    robot.breaks_at = 1000
    broken = await ended(station, await logs.download(MINI, "/logs/dive-1.csv", by="Kim"))
    assert (broken.state, broken.message) == ("failed", "The robot fell silent.")
    with pytest.raises(Problem, match="not ashore"):
        await logs.copy(MINI, listed["/logs/dive-1.csv"].id)
    robot.breaks_at = None
    whole = await ended(station, await logs.download(MINI, "/logs/dive-1.csv", by="Kim"))
    assert whole.state == "done"
    assert robot.offsets == [0, 1000]
    record, path = await logs.copy(MINI, listed["/logs/dive-1.csv"].id)
    assert path.read_bytes() == LOG
    assert record.fetched_size == len(LOG)


async def test_a_transfer_that_was_killed_goes_on_from_its_last_piece(station, logs, robot):
    await ended(station, await logs.read(MINI, by="Kim"))
    robot.breaks_at = 1200
    robot.gate.clear()
    job = await logs.download(MINI, "/logs/dive-1.csv", by="Kim")
    await until(lambda: robot.offsets)
    part = next((station.foundation.settings.data_dir / "robot-logs").glob("*.part"))
    await until(lambda: part.read_bytes() == LOG[:1200])
    await station.foundation.jobs.cancel(job)
    robot.breaks_at = None
    await ended(station, await logs.download(MINI, "/logs/dive-1.csv", by="Kim"))
    assert robot.offsets == [0, 1200]


async def test_who_comes_back_finds_the_work_under_way_and_what_came_of_it(station, logs, robot):
    nothing_yet = await logs.view(MINI)
    assert nothing_yet.job is None
    listing = await logs.read(MINI, by="Kim")
    assert (await logs.view(MINI)).job == listing
    await ended(station, listing)
    robot.breaks_at = 1200
    robot.gate.clear()
    job = await logs.download(MINI, "/logs/dive-1.csv", by="Kim")

    async def jobs():
        return {one.path: one.job for one in (await logs.view(MINI)).logs}

    assert await jobs() == {"/logs/dive-1.csv": job, "/readme.txt": None}
    robot.gate.set()
    assert (await ended(station, job)).message == "The robot fell silent."
    assert (await jobs())["/logs/dive-1.csv"] == job, "why it failed can still be asked"
    robot.breaks_at = None
    again = await logs.download(MINI, "/logs/dive-1.csv", by="Kim")
    assert (await jobs())["/logs/dive-1.csv"] == again != job
    await ended(station, again)


def test_a_partial_file_that_is_begun_anew_is_begun_anew_on_disk(tmp_path):
    path = tmp_path / "log.part"
    path.write_bytes(b"of another file")
    part = PartialFile(path)
    assert part.content == b"of another file"
    part.content.clear()
    part.content += b"right"
    part.keep()
    part.content += b" ones"
    part.keep()
    assert path.read_bytes() == b"right ones"
    part.complete(tmp_path / "log.bin")
    assert (tmp_path / "log.bin").read_bytes() == b"right ones"
    assert not path.exists()


async def test_a_file_that_nobody_named_is_not_asked_for(logs, robot):
    with pytest.raises(Problem, match="named no file"):
        await logs.download(MINI, "/etc/passwd", by="Kim")
    assert robot.offsets == []
