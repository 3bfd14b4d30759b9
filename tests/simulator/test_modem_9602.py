import asyncio
import os
import random
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import adafruit_rockblock
import pytest
import serial

from simulator.iridium.modem_9602 import Modem9602
from simulator.iridium.network import IridiumNetwork
from tests.robot_link.rig import until
from tests.simulator.iridium import IMEI, QUICK, network_of, rung

OK = b"\r\nOK\r\n"


class Host:
    """The computer at the modem's line."""

    def __init__(self, descriptor: int, modem: Modem9602) -> None:
        self._descriptor = descriptor
        self.modem = modem
        self.heard = b""

    def write(self, data: bytes) -> None:
        os.write(self._descriptor, data)

    async def until(self, end: bytes) -> bytes:
        """Return what the modem says up to and with ``end``."""
        async with asyncio.timeout(60.0):
            while end not in self.heard:
                await asyncio.sleep(0.002)
                try:
                    self.heard += os.read(self._descriptor, 4096)
                except BlockingIOError:
                    continue
        said, _, self.heard = self.heard.partition(end)
        return said + end

    async def ask(self, command: str, end: bytes = OK) -> bytes:
        self.write(command.encode() + b"\r")
        return await self.until(end)

    async def put(self, data: bytes) -> bytes:
        await self.ask(f"AT+SBDWB={len(data)}", b"READY\r\n")
        self.write(data + (sum(data) & 0xFFFF).to_bytes(2, "big"))
        return await self.until(OK)


@asynccontextmanager
async def host_of(
    folder: Path, network: IridiumNetwork, *, echo: bool = False, write_timeout_s: float = 60.0
) -> AsyncIterator[Host]:
    modem = Modem9602(IMEI, network, write_timeout_s=write_timeout_s)
    link = folder / "modem"
    async with modem.pty(link):
        descriptor = os.open(link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            host = Host(descriptor, modem)
            if not echo:
                await host.ask("ATE0")
            yield host
        finally:
            os.close(descriptor)
    assert not link.exists()


async def test_modem_rings_until_it_is_told_not_to(tmp_path: Path):
    network, _ = network_of()
    async with host_of(tmp_path, network) as host:
        for command, shown in (("AT", "1"), ("AT+SBDMTA=0", "0"), ("AT&F0", "1")):
            await host.ask(command)
            await host.ask("ATE0")
            assert await host.ask("AT+SBDMTA?") == f"\r\n+SBDMTA:{shown}\r\n\r\nOK\r\n".encode()


async def test_modem_echoes_until_it_is_told_not_to(tmp_path: Path):
    network, _ = network_of()
    async with host_of(tmp_path, network, echo=True) as host:
        assert await host.ask("AT") == b"AT\r\r\nOK\r\n"
        assert await host.ask("ATE0") == b"ATE0\r\r\nOK\r\n"
        assert await host.ask("AT") == OK
        assert await host.ask("at&k0") == OK


async def test_modem_says_who_it_is_and_what_it_hears(tmp_path: Path):
    network, _ = network_of()
    async with host_of(tmp_path, network) as host:
        assert await host.ask("AT+CGSN") == b"\r\n" + IMEI.encode() + b"\r\n" + OK
        bars = await host.ask("AT+CSQ")
        assert bars[:7] == b"\r\n+CSQ:"
        assert bars[7:8] in b"2345"
        network.conditions = replace(QUICK, outage=True)
        assert b"+CSQ:0" in await host.ask("AT+CSQ")


async def test_unknown_command_is_an_error_and_the_next_one_is_not(tmp_path: Path):
    network, _ = network_of()
    async with host_of(tmp_path, network) as host:
        for nonsense in ("AT+NONSENSE", "hello", "AT+SBDMTA=7", "ATV0"):
            assert await host.ask(nonsense, b"ERROR\r\n") == b"\r\nERROR\r\n"
        host.write(bytes(range(256)) * 20 + b"\r")
        await host.until(b"ERROR\r\n")
        assert OK in await host.ask("AT")


async def test_garbage_never_stops_the_modem(tmp_path: Path):
    network, _ = network_of()
    rng = random.Random(9)
    commands = (b"AT+SBDWB=", b"AT+SBDWT=", b"AT", b"at+SBDMTA=", b"AT+SBDIX=", b"\r\n", b"")
    async with host_of(tmp_path, network, write_timeout_s=0.01) as host:
        host.write(b"AT+SBDWB=" + b"9" * 5000 + b"\r")
        assert await host.until(OK) == b"\r\n3\r\n" + OK
        for _ in range(200):
            host.write(rng.choice(commands) + rng.randbytes(rng.randrange(40)) + b"\r")
            await asyncio.sleep(0.001)
            with suppress(BlockingIOError):
                os.read(host._descriptor, 65536)
        async with asyncio.timeout(60.0):
            while IMEI.encode() not in host.heard:  # it may take a question for a part of a message
                host.write(b"\rATZ\rAT+CGSN\r")
                await asyncio.sleep(0.1)
                with suppress(BlockingIOError):
                    host.heard += os.read(host._descriptor, 65536)


async def test_modem_tells_registration_and_the_networks_time(tmp_path: Path):
    network, _ = network_of()
    async with host_of(tmp_path, network) as host:
        assert b"TA19002" in await host.ask("AT+CGMR")
        assert b"+SBDREG:2,0" in await host.ask("AT+SBDREG?")
        before = network.clock.now()
        time = (await host.ask("AT-MSSTM")).split(b": ")[1].split()[0]
        after = network.clock.now()
        shown = datetime(2014, 5, 11, 14, 23, 55, tzinfo=UTC) + int(time, 16) * timedelta(
            milliseconds=90
        )
        assert before - timedelta(seconds=1) < shown < after + timedelta(seconds=1)
        assert b"+CRISX:0,0," in await host.ask("AT+CRISX")
        network.conditions = replace(QUICK, outage=True)
        assert b"+SBDREG:1,0" in await host.ask("AT+SBDREG?")
        assert b"no network service" in await host.ask("AT-MSSTM")


async def test_message_goes_in_with_its_sum_and_comes_out_of_the_loop_test_with_its_length(
    tmp_path: Path,
):
    network, _ = network_of()
    async with host_of(tmp_path, network) as host:
        await host.ask("AT+SBDWB=5", b"\r\nREADY\r\n")
        host.write(bytes.fromhex("68656c6c6f0214"))
        assert await host.until(OK) == b"\r\n0\r\n" + OK
        assert b"size = 5" in await host.ask("AT+SBDTC")
        assert await host.ask("AT+SBDRB") == bytes.fromhex("000568656c6c6f0214") + OK


async def test_empty_inbound_buffer_reads_as_no_bytes(tmp_path: Path):
    network, _ = network_of()
    async with host_of(tmp_path, network) as host:
        assert await host.ask("AT+SBDRB") == bytes(4) + OK


async def test_wrong_sum_wrong_size_and_silence_leave_the_buffer_as_it_was(tmp_path: Path):
    network, _ = network_of()
    async with host_of(tmp_path, network) as host:
        assert await host.put(b"kept") == b"\r\n0\r\n" + OK
        await host.ask("AT+SBDWB=2", b"READY\r\n")
        host.write(b"ab\x00\x00")
        assert await host.until(OK) == b"\r\n2\r\n" + OK
        for size in ("0", "341", "x"):
            assert await host.ask(f"AT+SBDWB={size}") == b"\r\n3\r\n" + OK
        host.modem._write_timeout_s = 0.05
        host.write(b"AT+SBDWB=9\rhalf")
        await host.until(b"READY\r\n")
        assert await host.until(OK) == b"\r\n1\r\n" + OK
        await host.ask("AT+SBDTC")
        assert b"kept" in await host.ask("AT+SBDRB")


async def test_session_tells_six_numbers_and_brings_binary_data(tmp_path: Path):
    network, told = network_of()
    down = bytes(range(256)) + bytes(14)
    network.accept(IMEI, down)
    network.accept(IMEI, b"next")
    await rung(network)
    async with host_of(tmp_path, network) as host:
        await host.put(bytes(range(255, -1, -1)))
        assert b"+SBDSX: 1, 0, 0, -1, 0, 0" in await host.ask("AT+SBDSX")
        assert b"+SBDIX: 0, 0, 1, 1, 270, 1" in await host.ask("AT+SBDIX")
        assert b"+SBDSX: 1, 1, 1, 1, 0, 1" in await host.ask("AT+SBDSX")
        sum_of_it = (sum(down) & 0xFFFF).to_bytes(2, "big")
        assert await host.ask("AT+SBDRB") == b"\x01\x0e" + down + sum_of_it + OK
        await until(lambda: told)
    assert [m.data for m in told] == [bytes(range(255, -1, -1))]


async def test_outbound_message_is_sent_again_unless_it_is_cleared(tmp_path: Path):
    network, told = network_of()
    async with host_of(tmp_path, network) as host:
        await host.put(b"up")
        await host.ask("AT+SBDIX")
        await host.ask("AT+SBDIX")
        assert await host.ask("AT+SBDD0") == b"\r\n0\r\n" + OK
        await host.ask("AT+SBDIX")
        await until(lambda: len(told) >= 3)
    assert sorted((m.momsn, m.data) for m in told) == [(0, b"up"), (1, b"up"), (2, b"")]


async def test_message_that_nobody_read_is_gone_after_the_next_session(tmp_path: Path):
    network, _ = network_of()
    network.accept(IMEI, b"first")
    network.accept(IMEI, b"second")
    await rung(network)
    async with host_of(tmp_path, network) as host:
        await host.ask("AT+SBDIX")
        await host.ask("AT+SBDIX")
        assert b"second" in await host.ask("AT+SBDRB")
        assert b"+SBDIX: 0, 2, 0, 0, 0, 0" in await host.ask("AT+SBDIX")
        assert await host.ask("AT+SBDRB") == bytes(4) + OK


async def test_failed_session_keeps_the_message_and_its_number(tmp_path: Path):
    network, _ = network_of(replace(QUICK, outage=True))
    async with host_of(tmp_path, network) as host:
        await host.put(b"up")
        assert b"+SBDIX: 32, 0, 2, 0, 0, 0" in await host.ask("AT+SBDIX")
        network.conditions = QUICK
        assert b"+SBDIX: 0, 0, 0, 0, 0, 0" in await host.ask("AT+SBDIX")


async def test_ring_is_told_where_it_was_asked_for_and_is_over_with_its_session(tmp_path: Path):
    network, _ = network_of()
    rings: list[float] = []
    network.on_ring(IMEI, lambda: rings.append(1.0))
    async with host_of(tmp_path, network) as host:
        network.accept(IMEI, b"unheard")
        await until(lambda: len(rings) == 2)
        await host.ask("AT+SBDMTA=1")
        assert b"SBDRING" not in await host.ask("AT+SBDMTA?")
        network.ring(IMEI)
        assert await host.until(b"SBDRING\r\n") == b"\r\nSBDRING\r\n"
        assert b", 1, 0\r\n" in await host.ask("AT+SBDSX")
        assert b"+SBDIX: 0, 0, 1, 1, 7, 0" in await host.ask("AT+SBDIXA")
        assert b", 0, 0\r\n" in await host.ask("AT+SBDSX")


async def test_ring_within_a_session_is_told_after_it(tmp_path: Path):
    network, _ = network_of(replace(QUICK, session_s=50.0))
    async with host_of(tmp_path, network) as host:
        await host.ask("AT+SBDMTA=1")
        host.write(b"AT+SBDIX\r")
        while not network._lines[IMEI].is_in_session:  # noqa: ASYNC110 - at every step of the loop
            await asyncio.sleep(0)
        network.ring(IMEI)
        assert b"SBDRING" not in await host.until(OK)
        await host.until(b"SBDRING\r\n")


async def test_text_messages_keep_their_case(tmp_path: Path):
    network, _ = network_of()
    async with host_of(tmp_path, network) as host:
        assert await host.ask("AT+SBDWT=Surface now") == OK
        await host.ask("AT+SBDTC")
        assert b"Surface now" in await host.ask("AT+SBDRT")
        assert await host.ask("AT+SBDWT=" + "x" * 121, b"ERROR\r\n") == b"\r\nERROR\r\n"
        await host.ask("AT+SBDWT", b"READY\r\n")
        assert await host.ask("on the next line") == OK
        await host.ask("AT+SBDTC")
        assert b"on the next line" in await host.ask("AT+SBDRT")


async def test_host_may_hang_up_and_come_back(tmp_path: Path):
    network, _ = network_of()
    modem = Modem9602(IMEI, network)
    async with modem.pty(tmp_path / "modem"):
        for _ in range(3):
            with serial.Serial(str(tmp_path / "modem"), 19200, timeout=60.0) as line:
                line.write(b"AT\r")
                assert await asyncio.to_thread(line.read_until, OK) == b"AT\r\r\nOK\r\n"


# ---- a driver of somebody else ----------------------------------------------------------------


async def driven(folder: Path, network: IridiumNetwork, drive: Callable[..., object]) -> object:
    """Let the Adafruit driver, which blocks, speak with the modem."""

    def work() -> object:
        with serial.Serial(str(folder / "modem"), 19200, timeout=60.0) as line:
            return drive(adafruit_rockblock.RockBlock(line))

    async with Modem9602(IMEI, network).pty(folder / "modem"), asyncio.timeout(90.0):
        return await asyncio.to_thread(work)


async def test_adafruit_driver_reads_the_modem(tmp_path: Path):
    network, _ = network_of()

    def drive(modem: adafruit_rockblock.RockBlock) -> object:
        modem.ring_alert = True
        return (modem.serial_number, modem.signal_quality, modem.model, modem.ring_alert)

    imei, bars, model, rings = await driven(tmp_path, network, drive)
    assert (imei, rings) == (IMEI, True)
    assert 2 <= bars <= 5
    assert "SBD" in model


def without_line_ends(size: int) -> bytes:
    """Return bytes of every other value: the driver takes LF and CR for the end of its data."""
    values = [value for value in range(256) if value not in (0x0A, 0x0D)]
    return bytes(values[n % len(values)] for n in range(size))


@pytest.mark.parametrize("size", [1, 100, 253])
async def test_adafruit_driver_exchanges_binary_messages(tmp_path: Path, size: int):
    network, told = network_of()
    down = without_line_ends(size)
    network.accept(IMEI, down)
    await rung(network)

    def drive(modem: adafruit_rockblock.RockBlock) -> object:
        modem.data_out = bytes(range(256))
        return (tuple(modem.satellite_transfer()), modem.data_in, tuple(modem.status))

    status, received, buffers = await driven(tmp_path, network, drive)
    assert status == (0, 0, 1, 1, size, 0)
    assert received == down
    assert buffers == (0, 1, 1, 1, 0, 0)
    await until(lambda: told)
    assert [m.data for m in told] == [bytes(range(256))]


async def test_adafruit_driver_sees_a_session_without_network(tmp_path: Path):
    network, _ = network_of(replace(QUICK, outage=True))

    def drive(modem: adafruit_rockblock.RockBlock) -> object:
        modem.text_out = "hello"
        return modem.satellite_transfer(), modem.status[0]

    status, is_kept = await driven(tmp_path, network, drive)
    assert status[0] == 32
    assert is_kept == 1
