import asyncio
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest

from robot_link.clock import SystemClock
from robot_link.station.gateway import directip
from robot_link.station.gateway.gateway import (
    GatewayFault,
    GatewayRefusal,
    GatewayUnreachableError,
    MobileOriginated,
)
from simulator.iridium.message_queue import CAPACITY
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.session import MobileOriginatedMessage, Place
from tests.robot_link.rig import until
from tests.simulator import directip_wire as wire
from tests.simulator.directip_gateway import DirectIpGateway
from tests.simulator.iridium import IMEI, QUICK, STARTED_AT, HandClock, network_of
from tests.tcp_peer import connected

MT_HEADER, MT_PAYLOAD, MT_PRIORITY = 0x41, 0x42, 0x46


def element(number: int, content: bytes) -> bytes:
    return struct.pack(">BH", number, len(content)) + content


def request(
    data: bytes | None = b"down",
    *,
    imei: str = IMEI,
    client: bytes = b"abcd",
    flags: int = 0,
    priority: int | None = None,
) -> bytes:
    body = element(MT_HEADER, client + imei.encode() + flags.to_bytes(2, "big"))
    if data is not None:
        body += element(MT_PAYLOAD, data)
    if priority is not None:
        body += element(MT_PRIORITY, priority.to_bytes(2, "big"))
    return struct.pack(">BH", 1, len(body)) + body


@asynccontextmanager
async def served(network: IridiumNetwork) -> AsyncIterator[tuple[DirectIpGateway, int]]:
    gateway = DirectIpGateway(network, None)
    async with gateway.serve() as url:
        yield gateway, int(url.split(":")[2])


async def sent(port: int, data: bytes) -> bytes:
    async with connected(port) as (reader, writer):
        writer.write(data)
        writer.write_eof()
        return await reader.read()


async def status(port: int, data: bytes) -> int:
    answer = await sent(port, data)
    assert answer[:6] == bytes.fromhex("01001c440019")
    assert len(answer) == 31
    return int.from_bytes(answer[-2:], "big", signed=True)


def directip_network(**changes) -> IridiumNetwork:
    return network_of(replace(QUICK, **changes), carrier="directip")[0]


# ---- to a modem -----------------------------------------------------------------------------


async def test_confirmation_tells_position_and_repeats_who_was_meant():
    network = directip_network()
    async with served(network) as (_, port):
        assert await status(port, request()) == 1
        answer = await sent(port, request(client=b"wxyz"))
    assert answer[6:10] == b"wxyz"
    assert answer[10:25] == IMEI.encode()
    assert answer[25:29] == (2).to_bytes(4, "big")
    assert answer[29:] == (2).to_bytes(2, "big")
    assert [m.data for m in network.waiting(IMEI)] == [b"down"] * 2


async def test_order_of_elements_is_free_and_unknown_ones_are_skipped():
    network = directip_network()
    body = (
        element(MT_PAYLOAD, b"down")
        + element(0x77, b"what is this")
        + element(MT_HEADER, b"abcd" + IMEI.encode() + bytes(2))
    )
    async with served(network) as (_, port):
        assert await status(port, struct.pack(">BH", 1, len(body)) + body) == 1


async def test_priorities_overtake_so_that_numbers_do_not_ascend():
    network = directip_network(latency_s=0.0, jitter_s=0.0)
    async with served(network) as (_, port):
        for priority in (5, 3, 9):
            assert await status(port, request(bytes((priority,)), priority=priority)) > 0
        assert await status(port, request(b"h", flags=wire.HIGH_PRIORITY)) == 1
    results = [await network.session(IMEI, None) for _ in range(4)]
    assert [r.mt_data for r in results] == [b"h", b"\x03", b"\x05", b"\x09"]
    assert [r.mtmsn for r in results] == [4, 2, 1, 3]


async def test_customer_may_assign_the_message_number():
    network = directip_network(latency_s=0.0, jitter_s=0.0)
    async with served(network) as (_, port):
        client = (4711).to_bytes(4, "big")
        assert await status(port, request(client=client, flags=wire.ASSIGN_MTMSN)) == 1
        assert await status(port, request(client=bytes(4), flags=wire.ASSIGN_MTMSN)) == -11
    assert (await network.session(IMEI, None)).mtmsn == 4711


async def test_flush_and_ring_need_no_payload():
    network = directip_network()
    rings: list[float] = []
    network.on_ring(IMEI, lambda: rings.append(1.0))
    async with served(network) as (_, port):
        assert await status(port, request()) == 1
        assert await status(port, request(None, flags=wire.FLUSH)) == 0
        assert network.waiting(IMEI) == ()
        assert await status(port, request(None, flags=wire.RING_ONLY)) == 0
        assert rings
        network.subscriber(IMEI).is_ring_enabled = False
        assert await status(port, request(None, flags=wire.RING_ONLY)) == -8


@pytest.mark.parametrize(
    ("wrong", "code"),
    [
        ({"imei": "30023401075337x"}, -1),
        ({"imei": "300234010000000"}, -2),
        ({"data": bytes(271)}, -3),
        ({"data": None}, -4),
        ({"flags": wire.RING_ONLY | wire.ASSIGN_MTMSN}, -7),
        ({"flags": wire.RING_ONLY}, -7),
    ],
)
async def test_each_fault_of_the_customer_has_its_status(wrong: dict[str, object], code: int):
    network = directip_network()
    async with served(network) as (_, port):
        assert await status(port, request(**wrong)) == code
    assert network.waiting(IMEI) == ()


async def test_queue_attachment_address_and_the_gateway_itself_can_refuse():
    network = directip_network()
    async with served(network) as (gateway, port):
        for _ in range(CAPACITY):
            await status(port, request(priority=1))
        assert await status(port, request()) == -5
        network.subscriber(IMEI).is_attached = False
        assert await status(port, request()) == -9
        network.conditions = replace(QUICK, gateway_failure=1.0)
        assert await status(port, request()) == -6
        gateway.refuses_address = True
        assert await status(port, request()) == -10


async def test_message_cut_at_any_byte_is_dropped_without_a_word():
    network = directip_network()
    whole = request(priority=3)
    async with served(network) as (_, port):
        for length in range(len(whole)):
            assert await sent(port, whole[:length]) == b""
        assert await status(port, whole) == 1
    assert len(network.waiting(IMEI)) == 1


async def test_elements_that_do_not_fit_their_message_are_a_protocol_error():
    network = directip_network()
    async with served(network) as (_, port):
        for body in (b"\x41\x00", b"\x41\x00\x15abc", element(MT_PAYLOAD, b"x"), b""):
            assert await status(port, struct.pack(">BH", 1, len(body)) + body) == -7
        assert await sent(port, b"\x02\x00\x00") == b""


# ---- from a modem ---------------------------------------------------------------------------


def test_session_is_packed_as_the_real_gateway_does():
    captured = (
        "01005e01001c7bf6dc11333031343334303631373939343830000007000068c75020"
        "03000b022b7a26ac8dc40000000202002e"
    )
    text = b"Thanks for your amazing sbd-rs repo @gadomski!"
    message = MobileOriginatedMessage(
        record_id=2079775761,
        imei="301434061799480",
        session_at=STARTED_AT.replace(year=2025, month=9, day=14, hour=23, minute=30, second=40),
        session_status=0,
        momsn=7,
        mtmsn=0,
        data=text,
        latitude_deg=-(43 + 31.270 / 60),
        longitude_deg=172 + 36.292 / 60,
        cep_km=2,
    )
    assert wire.pack_mobile_originated(message) == bytes.fromhex(captured) + text


@asynccontextmanager
async def customer(
    *, confirms: bool = False, fails: int = 0
) -> AsyncIterator[tuple[str, list[MobileOriginated]]]:
    """The station's listener, which cannot keep the first ``fails`` messages."""
    kept: list[MobileOriginated] = []
    failures = iter(range(fails))

    async def keep(message: MobileOriginated) -> None:
        if next(failures, None) is not None:
            raise RuntimeError("the disk is full")
        kept.append(message)

    listener = directip.Listener("127.0.0.1", 0, keep, SystemClock(), confirms=confirms)
    await listener.start()
    try:
        yield f"tcp://127.0.0.1:{listener.port}", kept
    finally:
        await listener.stop()


@pytest.mark.parametrize("confirms", [False, True])
async def test_station_keeps_what_is_delivered(confirms: bool):
    network, told = network_of(clock=HandClock(), carrier="directip")
    network.accept(IMEI, b"down")
    network.clock.advance(seconds=5)
    async with customer(confirms=confirms) as (url, kept):
        gateway = DirectIpGateway(network, url, confirms=confirms)
        async with gateway.serve():
            await network.session(IMEI, b"up\r\n\x00", Place(-43.5, 172.6))
            await until(lambda: gateway.pusher.delivered)
    (message,) = kept
    assert (message.imei, message.momsn, message.mtmsn) == (IMEI, 0, 1)
    assert message.data == b"up\r\n\x00"
    assert message.session_at == network.clock.now()
    assert message.latitude_deg == pytest.approx(told[0].latitude_deg, abs=1e-5)
    assert message.longitude_deg == pytest.approx(told[0].longitude_deg, abs=1e-5)


async def test_message_that_was_not_confirmed_is_delivered_again_and_none_overtakes_it():
    network, _ = network_of(carrier="directip")
    async with customer(confirms=True, fails=2) as (url, kept):
        gateway = DirectIpGateway(network, url, confirms=True)
        async with gateway.serve():
            for number in range(3):
                await network.session(IMEI, bytes((number,)))
            await until(lambda: gateway.pusher.delivered == 3)
    assert [m.data for m in kept] == [b"\x00", b"\x01", b"\x02"]


async def test_station_that_is_down_gets_everything_when_it_is_back():
    network, _ = network_of(carrier="directip")
    gateway = DirectIpGateway(network, "tcp://127.0.0.1:9")
    async with gateway.serve(), customer() as (url, kept):
        await network.session(IMEI, b"one")
        await network.session(IMEI, None)
        await until(lambda: gateway.pusher.waiting == 2)
        gateway.point_to(url)
        await until(lambda: gateway.pusher.delivered == 2)
    assert [m.data for m in kept] == [b"one", b""]


async def test_session_that_broke_off_is_told_without_a_payload():
    network, told = network_of(
        replace(QUICK, mobile_originated_loss=1.0), seed=5, carrier="directip"
    )
    async with customer() as (url, kept):
        gateway = DirectIpGateway(network, url)
        async with gateway.serve():
            while not any(m.session_status for m in told):
                await network.session(IMEI, b"up")
                await asyncio.sleep(0.02)
            await until(lambda: gateway.pusher.delivered == len(told))
    assert {(m.session_status, m.data) for m in kept} <= {(0, b"up"), (13, b"")}
    assert (13, b"") in {(m.session_status, m.data) for m in kept}


def test_customer_must_be_this_machine_and_have_a_port():
    network = directip_network()
    with pytest.raises(ValueError, match="this machine only"):
        DirectIpGateway(network, "tcp://192.0.2.1:10800")
    with pytest.raises(ValueError, match="tcp://host:port"):
        DirectIpGateway(network, "tcp://127.0.0.1")


# ---- with the station's own client ------------------------------------------------------------


async def test_station_sends_through_it_and_learns_number_and_position():
    network = directip_network(latency_s=0.0, jitter_s=0.0)
    async with DirectIpGateway(network, None).serve() as url:
        client = directip.DirectIpGateway("127.0.0.1", int(url.split(":")[2]))
        taken = await client.send(IMEI, bytes(270), client_id=77)
        assert (taken.message_id, taken.mtmsn, taken.position) == ("1", 77, 1)
        with pytest.raises(GatewayRefusal) as refusal:
            await client.send("300234010000000", b"x", client_id=1)
        assert refusal.value.fault is GatewayFault.UNKNOWN_IMEI
        for trouble in ("gateway_outage", "answer_loss"):
            network.conditions = replace(QUICK, **{trouble: 1.0})
            with pytest.raises(GatewayUnreachableError):
                await client.send(IMEI, b"x", client_id=2)
    result = await network.session(IMEI, None)
    assert (result.mtmsn, result.mt_data) == (77, bytes(270))
