import asyncio
import os
import random
import statistics
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from robot_link.acoustic.config import AcousticConfig
from robot_link.acoustic.measurement import MiniReceived, RangeMeasurement
from robot_link.acoustic.micromodem import MicroModem, open_modem
from robot_link.messages import RobotId
from simulator.acoustic_modem import AcousticConditions, AcousticModem, AcousticNode, Point
from tests.robot_link.rig import until
from tests.simulator.iridium import running_clock

STILL = AcousticConditions(travel_time_std_s=0.0)
NEAR: Point = (0.0, 15.15, 0.0)
"""0.0101 s away."""


def sentence(body: str) -> bytes:
    total = 0
    for octet in body.encode():
        total ^= octet
    return f"${body}*{total:02X}\r\n".encode()


class Host:
    """The computer at the modem's line."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._rest = b""

    def write(self, data: bytes) -> None:
        os.write(self._descriptor, data)

    def ask(self, body: str) -> None:
        self.write(sentence(body))

    async def line(self) -> bytes:
        async with asyncio.timeout(60.0):
            while b"\r\n" not in self._rest:
                await asyncio.sleep(0.002)
                try:
                    self._rest += os.read(self._descriptor, 4096)
                except BlockingIOError:
                    continue
        line, _, self._rest = self._rest.partition(b"\r\n")
        return line + b"\r\n"

    async def says(self, body: str) -> bool:
        return await self.line() == sentence(body)


def modem_of(
    conditions: AcousticConditions = STILL, position: Point | None = NEAR, seed: int = 1, **options
) -> AcousticModem:
    """Return a modem with one other one, number 2."""
    nodes = {2: AcousticNode(lambda: position, **options)}
    rng = random.Random(seed)
    return AcousticModem(lambda: (0.0, 0.0, 0.0), nodes, rng, conditions, running_clock(100.0))


@asynccontextmanager
async def host_of(folder: Path, modem: AcousticModem) -> AsyncIterator[Host]:
    async with modem.pty(folder / "modem"):
        descriptor = os.open(folder / "modem", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            yield Host(descriptor)
        finally:
            os.close(descriptor)


async def test_ping_is_echoed_and_answered_with_the_travel_time(tmp_path: Path):
    async with host_of(tmp_path, modem_of()) as host:
        host.ask("CCMPC,1,2")
        assert await host.says("CAMPC,1,2")
        assert await host.says("CAMPR,1,2,0.0101")


async def test_reply_of_the_other_order_is_the_published_sentence(tmp_path: Path):
    other = AcousticConditions(travel_time_std_s=0.0, replier_first=True)
    async with host_of(tmp_path, modem_of(other)) as host:
        host.ask("CCMPC,1,2")
        await host.line()
        assert await host.line() == b"$CAMPR,2,1,0.0101*7C\r\n"


async def ranges(
    folder: Path, conditions: AcousticConditions, count: int, seed: int = 1
) -> list[float]:
    """Return the travel times of many pings, s."""
    times: list[float] = []
    async with host_of(folder, modem_of(conditions, seed=seed)) as host:
        for _ in range(count):
            host.ask("CCMPC,1,2")
            assert await host.says("CAMPC,1,2")
            reply = await host.line()
            times.append(float(reply.split(b",")[3].split(b"*")[0]))
    return times


async def test_travel_times_scatter_as_told(tmp_path: Path):
    noisy = AcousticConditions(travel_time_std_s=0.001)
    times = await ranges(tmp_path, noisy, 150)
    assert statistics.mean(times) == pytest.approx(0.0101, abs=0.0003)
    assert statistics.stdev(times) == pytest.approx(0.001, rel=0.25)


async def test_echo_taken_for_the_sound_is_late(tmp_path: Path):
    echoing = AcousticConditions(travel_time_std_s=0.0, outliers=1.0, echo_s=0.03)
    for time in await ranges(tmp_path, echoing, 10):
        assert 0.0101 + 0.006 <= time <= 0.0101 + 0.03 + 1e-4


async def test_same_seed_gives_the_same_ranges(tmp_path: Path):
    noisy = AcousticConditions(outliers=0.2)
    first = await ranges(tmp_path, noisy, 10, seed=4)
    assert first == await ranges(tmp_path, noisy, 10, seed=4)
    assert first != await ranges(tmp_path, noisy, 10, seed=5)


@pytest.mark.parametrize(
    ("conditions", "position", "destination"),
    [
        (AcousticConditions(loss=1.0), NEAR, 2),
        (AcousticConditions(range_m=10.0), NEAR, 2),
        (STILL, None, 2),
        (STILL, NEAR, 3),
    ],
    ids=["lost", "too far", "out of the water", "nobody of this number"],
)
async def test_ping_that_nobody_answers_is_echoed_alone(
    tmp_path: Path, conditions: AcousticConditions, position: Point | None, destination: int
):
    async with host_of(tmp_path, modem_of(conditions, position)) as host:
        host.ask(f"CCMPC,1,{destination}")
        assert await host.says(f"CAMPC,1,{destination}")
        await asyncio.sleep(0.05)
        host.ask("CCCFQ,SRC")
        assert await host.says("CACFG,SRC,0")


async def test_garbled_reply_is_a_bad_crc(tmp_path: Path):
    async with host_of(tmp_path, modem_of(AcousticConditions(garbling=1.0))) as host:
        host.ask("CCMPC,1,2")
        await host.line()
        assert await host.says("CAMSG,BAD_CRC,2")


async def test_mini_packets_go_both_ways(tmp_path: Path):
    heard: list[tuple[int, int]] = []
    modem = modem_of(hear=lambda source, word: heard.append((source, word)))
    async with host_of(tmp_path, modem) as host:
        host.ask("CCCFG,SRC,1")
        assert await host.says("CACFG,SRC,1")
        host.ask("CCMUC,1,2,1abc")
        assert await host.says("CAMUC,1,2,1abc")
        await until(lambda: heard == [(1, 0x1ABC)])
        modem.send_mini(2, 0x0DE)
        assert await host.says("CAMUA,2,1,00de")
    with pytest.raises(ValueError, match="13 bits"):
        modem.send_mini(2, 0x2000)


async def test_transponders_answer_within_the_time_out(tmp_path: Path):
    places = {"A": (0.0, 150.0, 0.0), "B": (0.0, 1400.0, 0.0), "D": (0.0, 0.0, 30.0)}
    transponders = {name: AcousticNode(lambda at=at: at) for name, at in places.items()}
    modem = AcousticModem(
        lambda: (0.0, 0.0, 0.0), {}, random.Random(1), STILL, running_clock(100.0), transponders
    )
    async with host_of(tmp_path, modem) as host:
        host.ask("CCPDT,1,1,0,0,500,1,1,1,1")
        assert await host.says("SNPDT,1,1,0,0,500,1,1,1,1")
        answer = await host.line()
        assert answer.startswith(b"$SNTTA,0.1000,,,0.0200,")
        host.ask("CCPNT,26000,5,5,500,25000,0,0,0,1")
        await host.line()
        assert (await host.line()).startswith(b"$SNTTA,0.1000,,,,")


async def test_settings_are_told_and_clock_is_set(tmp_path: Path):
    modem = modem_of()
    async with host_of(tmp_path, modem) as host:
        host.ask("CCCFG,CST,0")
        assert await host.says("CACFG,CST,0")
        host.ask("CCCFQ,CST")
        assert await host.says("CACFG,CST,0")
        for command in ("CLK,2026,3,14,12,0,0", "TMS,2026-03-14T12:00:00Z,0"):
            modem.is_clock_set = False
            host.ask(f"CC{command}")
            assert await host.says(f"CA{command}")
            assert modem.is_clock_set
        host.ask("CCCFQ,ALL")
        for name in sorted(modem.settings):
            assert await host.says(f"CACFG,{name},{modem.settings[name]}")


@pytest.mark.parametrize("by_host", [False, True])
async def test_restart_is_told_and_settings_are_forgotten(tmp_path: Path, by_host: bool):
    modem = modem_of()
    async with host_of(tmp_path, modem) as host:
        host.ask("CCCFG,SRC,7")
        host.ask("CCCLK,2026,3,14,12,0,0")
        await host.line()
        await host.line()
        if by_host:
            host.ask("CCMSC,7,7,0")
            assert await host.says("CAMSC,7,7,0")
        else:
            modem.reboot()
        words = (await host.line()).split(b",")
        assert (words[0], words[2]) == (b"$CAREV", b"INIT")
        assert len(words[1]) == 6
    assert modem.settings["SRC"] == 0
    assert not modem.is_clock_set


@pytest.mark.parametrize(
    "wrong",
    [
        b"$CCMPC,1,2*00\r\n",
        b"$CAMPR,1,2,0.1\r\n",
        b"garbage\r\n",
        b"$CCMPC,1\r\n",
        b"$CCMPC,a,b\r\n",
        b"$CCMUC,1,2,ffff\r\n",
        b"$CCPDT,1,1,0,0,500\r\n",
        b"$CCPDT,1,1,0,0,-5,1,1,1,1\r\n",
        b"$CCCFG,LONGER,1\r\n",
        b"$CCXYZ,1\r\n",
        bytes(range(256)) + b"\r\n",
    ],
)
async def test_sentence_that_is_none_is_complained_of_and_the_next_is_obeyed(
    tmp_path: Path, wrong: bytes
):
    async with host_of(tmp_path, modem_of()) as host:
        host.write(wrong)
        answer = await host.line()
        assert answer.startswith(b"$CAERR,")
        assert b",NMEA," in answer
        host.ask("CCCFQ,SRC")
        while not (answer := await host.line()).startswith(b"$CACFG"):
            assert answer.startswith(b"$CAERR,")


async def test_garbage_never_stops_the_modem(tmp_path: Path):
    rng = random.Random(9)
    names = ("MPC,", "MUC,1,2,", "PDT,1,1,0,0,", "CFG,", "PNT,", "MSC,", "CLK,", "")
    async with host_of(tmp_path, modem_of()) as host:
        host.write(b"$CCPDT,1,1,0,0," + b"9" * 400 + b",1,1,1,1\r\n")
        assert b"bad field" in await host.line()
        for _ in range(300):
            host.write(b"$CC" + rng.choice(names).encode() + rng.randbytes(20) + b"\r\n")
            await asyncio.sleep(0)
        host.ask("CCCFQ,SRC")
        while not (await host.line()).startswith(b"$CACFG,SRC"):
            pass


async def test_checksum_may_be_left_out_and_sentences_may_come_in_pieces(tmp_path: Path):
    async with host_of(tmp_path, modem_of()) as host:
        for piece in (b"$CCM", b"PC,1", b",2\r"):
            host.write(piece)
            await asyncio.sleep(0.005)
        assert await host.says("CAMPC,1,2")


# ---- with the station's own driver -------------------------------------------------------------


@asynccontextmanager
async def driver_of(
    folder: Path, on_mini: Callable[[MiniReceived], None] = lambda _: None
) -> AsyncIterator[MicroModem]:
    driver = open_modem(
        {RobotId("grace-1"): f"micromodem://{folder}/modem?us=1&peer=2"},
        running_clock(100.0),
        AcousticConfig(range_max_m=150.0),
        on_mini=on_mini,
    )
    running = asyncio.create_task(driver.run())
    try:
        await until(lambda: driver.is_ready)
        yield driver
    finally:
        running.cancel()
        await asyncio.wait((running,))


async def answered(driver: MicroModem) -> RangeMeasurement:
    """Ping until an answer is in time: a busy machine may be late with one."""
    for _ in range(20):
        if (measured := await driver.ping(2)).is_valid:
            return measured
    raise AssertionError(measured.reason)


async def test_driver_configures_ranges_and_exchanges_minis(tmp_path: Path):
    heard: list[tuple[int, int]] = []
    minis: list[MiniReceived] = []
    modem = modem_of(hear=lambda source, word: heard.append((source, word)))
    async with modem.pty(tmp_path / "modem"), driver_of(tmp_path, minis.append) as driver:
        assert modem.settings["SRC"] == 1
        measured = await answered(driver)
        assert measured.range_m == pytest.approx(15.15, abs=0.1)
        await driver.mini(2, 0x1ABC)
        await until(lambda: heard == [(1, 0x1ABC)])
        modem.send_mini(2, 0x0DE)
        await until(lambda: minis)
        assert (minis[0].robot, minis[0].word) == ("grace-1", 0x0DE)


async def test_driver_takes_either_order_and_tells_garbled_from_silent(tmp_path: Path):
    modem = modem_of(AcousticConditions(travel_time_std_s=0.0, replier_first=True))
    async with modem.pty(tmp_path / "modem"), driver_of(tmp_path) as driver:
        assert (await answered(driver)).is_valid
        modem.conditions = AcousticConditions(garbling=1.0)
        reasons = []
        while not any("garbled" in reason for reason in reasons):
            garbled = await driver.ping(2)
            assert not garbled.is_valid
            reasons.append(garbled.reason)
            assert len(reasons) < 20


async def test_driver_configures_a_modem_again_that_has_restarted(tmp_path: Path):
    modem = modem_of()
    async with modem.pty(tmp_path / "modem"), driver_of(tmp_path) as driver:
        await until(lambda: modem.is_clock_set)
        modem.reboot()
        assert modem.settings["SRC"] == 0
        await until(lambda: modem.settings["SRC"] == 1 and modem.is_clock_set)
        assert (await answered(driver)).is_valid
