"""Ranges to targets through the water: from the emulated modem to what the program hears."""

import asyncio
import math
import os
import random
import statistics
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import pytest

from autonomy.tracking.config import RangingConfig
from onboard.node.client import NodeClient
from onboard.node.server import NodeServer
from onboard.node.wire import NodeAddress, NodeError, NodeFault
from onboard.target.pinger import Pinger
from robot_link.clock import ScaledClock
from simulator.acoustic_modem import AcousticModem, AcousticNode
from simulator.background import alongside
from simulator.equipment import Timekeeping, equipped
from simulator.fleet import GRACE_1, MINI_1, STATION_ADDRESS, RobotDefinition
from simulator.process import satellites
from simulator.robot import SimulatedBody
from simulator.settings import SimulatorSettings
from simulator.target import LAKE_TARGETS, TANK_TARGETS
from tests.robot_link.rig import until
from tests.simulator.iridium import running_clock
from tests.simulator.test_acoustic_modem import STILL, host_of

TAG, BEACON = 10, 11
SOUND_M_S = 1500.0
NOISE_M = MINI_1.acoustics.travel_time_std_s * SOUND_M_S
STEP_M = 0.075
"""Half of what the modem's four decimals of a second are in range."""


def settings_of(folder: Path, definition: RobotDefinition, speed: float, **changes):
    now = datetime.now(UTC)
    return SimulatorSettings(
        link_folder=folder,
        wall_anchor=now,
        time_anchor=now,
        speed=speed,
        robots=(definition.robot,),
        **changes,
    )


@asynccontextmanager
async def in_water(
    folder: Path, definition: RobotDefinition, speed: float = 20.0, **changes
) -> AsyncIterator[tuple[SimulatedBody, NodeClient, ScaledClock]]:
    """A robot that does not move, its devices, and a client of its acoustic node."""
    settings = settings_of(folder, definition, speed, **changes)
    clock = settings.clock()
    body = SimulatedBody(definition, 0)
    time = Timekeeping.of(definition, 0, clock)
    network = satellites(settings, lambda _imei: True)
    async with equipped(settings, definition, body, time, network) as equipment:
        client = equipment.client("acoustic")
        async with alongside(client.run(), "client"):
            await client.connected()
            await modem_is_ready(client)
            yield body, client, clock


async def modem_is_ready(client: NodeClient) -> None:
    for _ in range(200):
        answer = await client.ask("ping", peer=TAG, timeout_s=20.0)
        if answer["reason"] != "the modem is not there":
            return
        await asyncio.sleep(0.02)
    raise AssertionError("the modem never was ready")


@dataclass
class Program:
    """Wants ranges of one target, and keeps them."""

    clock: ScaledClock
    ranging: RangingConfig | None = field(default_factory=RangingConfig)
    wanted: int | None = TAG
    heard: list[tuple[float | None, float]] = field(default_factory=list)
    asleep_s: float | None = None
    """Where its time is set by hand."""

    def __post_init__(self) -> None:
        self.began = self.clock.now()

    @property
    def time_s(self) -> float:
        elapsed_s = (self.clock.now() - self.began).total_seconds()
        return elapsed_s if self.asleep_s is None else self.asleep_s

    @property
    def ranges(self) -> list[float]:
        return [range_m for range_m, _ in self.heard if range_m is not None]

    def wants_range(self) -> int | None:
        return self.wanted

    def hear_range(self, range_m: float | None, age_s: float) -> None:
        self.heard.append((range_m, age_s))


def slant_m(body: SimulatedBody, place: tuple[float, float, float]) -> float:
    return math.dist(body.plant.position_ned, place)


# ---- the modem ---------------------------------------------------------------------------------


async def test_range_to_a_moving_target_is_the_mean_of_there_and_back(tmp_path: Path):
    places = iter([(0.0, 15.0, 0.0), (0.0, 30.0, 0.0)])
    target = AcousticNode(lambda: next(places))
    clock = running_clock(100.0)
    modem = AcousticModem(lambda: (0.0, 0.0, 0.0), {TAG: target}, random.Random(1), STILL, clock)
    async with host_of(tmp_path, modem) as host:
        host.ask("CCMPC,1,10")
        assert await host.says("CAMPC,1,10")
        assert await host.says(f"CAMPR,1,10,{22.5 / SOUND_M_S:.4f}")


async def test_target_that_leaves_the_water_between_ping_and_answer_is_silent(tmp_path: Path):
    places = iter([(0.0, 15.0, 0.0), None, (0.0, 15.0, 0.0), (0.0, 15.0, 0.0)])
    target = AcousticNode(lambda: next(places))
    clock = running_clock(100.0)
    modem = AcousticModem(lambda: (0.0, 0.0, 0.0), {TAG: target}, random.Random(1), STILL, clock)
    async with host_of(tmp_path, modem) as host:
        for _ in range(2):
            host.ask("CCMPC,1,10")
            assert await host.says("CAMPC,1,10")
            await asyncio.sleep(0.02)
        assert await host.says("CAMPR,1,10,0.0100")


# ---- the water of tank and lake ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("definition", "target"),
    [(MINI_1, TANK_TARGETS[0]), (GRACE_1, LAKE_TARGETS[0]), (GRACE_1, LAKE_TARGETS[1])],
)
async def test_ping_gives_the_true_range_within_the_noise(tmp_path: Path, definition, target):
    std_m = definition.acoustics.travel_time_std_s * SOUND_M_S
    async with in_water(tmp_path, definition) as (body, client, clock):
        ranges, true = [], []
        while len(ranges) < 20:
            true.append(slant_m(body, target.place_ned_m(clock.now())))
            answer = await client.ask("ping", peer=target.address, timeout_s=20.0)
            true.append(slant_m(body, target.place_ned_m(clock.now())))
            if answer["is_valid"]:
                ranges.append(answer["range_m"])
    drift_m = max(true) - min(true)
    mean_m = statistics.mean(ranges)
    assert mean_m == pytest.approx(statistics.mean(true), abs=std_m + STEP_M + drift_m)
    assert all(abs(one - mean_m) < 5.0 * std_m + STEP_M + drift_m for one in ranges)
    assert statistics.stdev(ranges) > 0.3 * std_m


async def test_robot_without_a_station_in_its_water_has_no_line_for_one(tmp_path: Path):
    async with in_water(tmp_path, MINI_1) as (_, client, _clock):
        assert [name for name in os.listdir(tmp_path) if "acoustic" in name] == ["mini-1-acoustic"]
        with pytest.raises(NodeError, match="no robot has the acoustic modem 1"):
            await client.ask("ping", peer=STATION_ADDRESS)


async def test_part_of_the_pings_is_lost_and_part_of_the_ranges_wrong_as_told(tmp_path: Path):
    """Of 80 ranges a half is wrong: less than a fifth, or more than four, once in ten million."""
    trouble = {"acoustic_loss": 0.3, "acoustic_outliers": 0.5}
    (tag,) = TANK_TARGETS
    late_m, lost = [], []
    async with in_water(tmp_path, MINI_1, speed=50.0, **trouble) as (body, client, clock):
        while len(late_m) < 80:
            answer = await client.ask("ping", peer=TAG, timeout_s=20.0)
            if answer["is_valid"]:
                late_m.append(answer["range_m"] - slant_m(body, tag.place_ned_m(clock.now())))
            else:
                lost.append(answer["reason"])
            assert len(lost) < 2000, "0.7 * 0.7 of them are answered"
    assert len(lost) > 0.2 * 80
    echoes = [one for one in late_m if one > 1.2]
    assert 0.2 * len(late_m) < len(echoes) < 0.8 * len(late_m)
    assert max(late_m) < 0.004 * SOUND_M_S + 6.0 * NOISE_M + 0.6  # the tag goes round in 0.6 m
    assert any("no answer" in reason for reason in lost)


async def test_garbled_answers_are_told_from_silence(tmp_path: Path):
    async with in_water(tmp_path, MINI_1, speed=50.0, acoustic_garbling=0.9) as (_, client, _c):
        for _ in range(1000):
            answer = await client.ask("ping", peer=TAG, timeout_s=20.0)
            if "garbled" in answer["reason"]:
                return
    raise AssertionError("no answer was garbled")


# ---- the pinger --------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [1.0, 20.0])
async def test_program_hears_ranges_with_their_age_at_any_speed(tmp_path: Path, speed: float):
    (tag,) = TANK_TARGETS
    async with in_water(tmp_path, MINI_1, speed) as (body, client, clock):
        program = Program(clock)
        async with alongside(Pinger(program, client, clock).run(), "pinger"):
            await until(lambda: len(program.ranges) >= 8)
        true_m = slant_m(body, tag.place_ned_m(clock.now()))
    assert statistics.median(program.ranges) == pytest.approx(true_m, abs=0.8)
    assert all(0.0 <= age_s < program.time_s for _, age_s in program.heard)


async def test_lost_pings_are_told_as_none(tmp_path: Path):
    async with in_water(tmp_path, MINI_1, 20.0, acoustic_loss=0.5) as (_, client, clock):
        program = Program(clock)
        async with alongside(Pinger(program, client, clock).run(), "pinger"):
            await until(lambda: program.ranges and any(one is None for one, _ in program.heard))


@asynccontextmanager
async def pinging(answer, ranging: RangingConfig | None = None):
    """A program whose acoustic node answers as told."""
    server = NodeServer("acoustic", {"ping": answer}, ())
    clock = running_clock(20.0)
    program = Program(clock, ranging or RangingConfig(), asleep_s=0.0)
    async with server.serve() as address:
        client = NodeClient(address)
        async with alongside(client.run(), "client"):
            await client.connected()
            async with alongside(Pinger(program, client, clock).run(), "pinger"):
                yield program


def answered(travel_s: float | None, *, is_valid: bool = True) -> dict:
    return {"travel_time_s": travel_s, "is_valid": is_valid, "reason": ""}


async def test_range_is_as_old_as_half_of_what_question_and_answer_took():
    async def answer(values: dict) -> dict:
        program.asleep_s += 3.0
        return answered(0.01)

    async with pinging(answer, RangingConfig(sound_speed_m_s=1450.0)) as program:
        await until(lambda: program.heard)
    assert program.heard[0] == (pytest.approx(14.5), 1.5)


@pytest.mark.parametrize(
    "answer", [answered(None, is_valid=False), answered(0.01, is_valid=False), {}]
)
async def test_answer_that_is_no_measurement_is_told_as_none(answer: dict):
    async def answers(values: dict) -> dict:
        return answer

    async with pinging(answers) as program:
        await until(lambda: program.heard)
    assert {range_m for range_m, _ in program.heard} == {None}


async def test_node_that_refuses_is_told_as_none_and_asked_again():
    asked: list[int] = []

    async def refuse(values: dict) -> dict:
        asked.append(values["peer"])
        raise NodeError(NodeFault.REFUSED, "not now")

    async with pinging(refuse) as program:
        program.wanted = 12
        await until(lambda: len(program.heard) >= 3)
    assert {range_m for range_m, _ in program.heard} == {None}
    assert set(asked[1:]) == {12}


async def test_range_that_comes_after_the_robot_was_told_to_be_quiet_is_not_heard():
    quiet = asyncio.Event()
    asked: list[int] = []

    async def answer(values: dict) -> dict:
        asked.append(values["peer"])
        await quiet.wait()
        return answered(0.01)

    async with pinging(answer) as program:
        await until(lambda: asked)
        program.wanted = None
        quiet.set()
        await asyncio.sleep(0.2)
        assert (program.heard, asked) == ([], [TAG])
        program.wanted = BEACON
        await until(lambda: program.heard)
        assert asked[1] == BEACON


async def test_nobody_is_pinged_by_a_mission_without_ranging():
    asked: list[int] = []

    async def answer(values: dict) -> dict:
        asked.append(values["peer"])
        return answered(0.01)

    async with pinging(answer) as program:
        await until(lambda: program.heard)
        program.ranging = None
        under_way = 1
        before = len(asked)
        await asyncio.sleep(0.5)
        assert len(asked) <= before + under_way


async def test_node_that_is_not_there_is_told_as_none():
    clock = running_clock(20.0)
    program = Program(clock, asleep_s=0.0)
    client = NodeClient(NodeAddress.of("tcp://127.0.0.1:9"))
    async with alongside(Pinger(program, client, clock).run(), "pinger"):
        await until(lambda: program.heard)
    assert program.heard[0] == (None, 0.0)
