import asyncio
import json
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import replace
from datetime import UTC, datetime
from urllib.parse import parse_qs

import httpx
import jwt
import pytest
import rockblock_tools
from cryptography.hazmat.primitives.serialization import load_pem_public_key
from rockblock_tools.exception import ApiException

from robot_link.station.gateway import rockblock
from robot_link.station.gateway.gateway import GatewayFault, GatewayRefusal, GatewayUnreachableError
from simulator.iridium.message_queue import CAPACITY
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.rockblock_gateway import RockBlockGateway
from simulator.iridium.session import Place
from tests.free_port import free_port
from tests.robot_link.http_peer import http_peer
from tests.robot_link.rig import until
from tests.robot_link.signed_push import private_key, public_pem
from tests.simulator.iridium import IMEI, QUICK, HandClock, network_of
from tests.tcp_peer import connected

LOGIN = {"imei": IMEI, "username": "fleet", "password": "word"}
TAKEN = (200, "")
KEY = private_key()

LISTENER = """
import sys
from rockblock_tools import listen

def show(message):
    words = message.imei, message.momsn, message.data, message.transmit_time.isoformat()
    print(*words, message.iridium_latitude, flush=True)

listen("127.0.0.1", int(sys.argv[1]), show)
"""


@asynccontextmanager
async def served(network: IridiumNetwork, push_url: str | None = None) -> AsyncIterator[str]:
    async with RockBlockGateway(network, KEY, push_url).serve() as url:
        yield url


async def asked(url: str, **fields: str) -> str:
    async with httpx.AsyncClient(trust_env=False, timeout=60.0) as client:
        return (await client.post(url, data=LOGIN | fields)).text


# ---- to a modem -----------------------------------------------------------------------------


async def test_message_is_queued_and_charged():
    network, _ = network_of()
    async with served(network) as url:
        assert await asked(url, data="00ff" * 26) == "OK,1"
    assert [m.data for m in network.waiting(IMEI)] == [b"\x00\xff" * 26]
    assert network.credits_charged[IMEI] == 2


async def test_parameters_may_stand_in_the_query_too():
    network, _ = network_of()
    async with served(network) as url, httpx.AsyncClient(trust_env=False, timeout=60.0) as client:
        answer = await client.post(url, params=LOGIN | {"data": "61"})
        assert answer.text == "OK,1"
        assert (await client.get(url)).status_code == 405
        assert (await client.post(url + "/else")).status_code == 404


async def test_flush_empties_the_queue_first():
    network, _ = network_of()
    async with served(network) as url:
        await asked(url, data="61")
        await asked(url, data="62", flush="yes")
    assert [m.data for m in network.waiting(IMEI)] == [b"b"]


@pytest.mark.parametrize(
    ("fields", "code"),
    [
        ({"password": "wrong"}, 10),
        ({"username": ""}, 10),
        ({"imei": "300234010000000"}, 11),
        ({"data": "6x"}, 14),
        ({"data": "616"}, 14),
        ({"data": "00" * 271}, 15),
        ({"data": ""}, 16),
    ],
)
async def test_each_fault_of_the_customer_has_its_code(fields: dict[str, str], code: int):
    network, _ = network_of()
    async with served(network) as url:
        answer = await asked(url, **({"data": "61"} | fields))
    assert answer.startswith(f"FAILED,{code},")
    assert network.waiting(IMEI) == ()
    assert network.credits_charged[IMEI] == 0


async def test_contract_credit_and_the_gateway_itself_can_fail():
    network, _ = network_of()
    subscriber = network.subscriber(IMEI)
    async with served(network) as url:
        subscriber.has_line_rental = False
        assert (await asked(url, data="61")).startswith("FAILED,12,")
        subscriber.has_line_rental = True
        subscriber.account.credits_left = 1
        assert (await asked(url, data="61" * 51)).startswith("FAILED,13,")
        assert await asked(url, data="61") == "OK,1"
        subscriber.account.credits_left = None
        network.conditions = replace(QUICK, gateway_failure=1.0)
        assert (await asked(url, data="61")).startswith("FAILED,99,")


async def test_fifty_first_message_drops_the_oldest():
    network, _ = network_of()
    async with served(network) as url:
        for number in range(CAPACITY):
            network.accept(IMEI, bytes([number]))
        assert (await asked(url, data=f"{CAPACITY:02x}")).startswith("OK,")
    waiting = [m.data[0] for m in network.waiting(IMEI)]
    assert waiting == list(range(1, CAPACITY + 1))


async def test_lost_answer_hides_that_the_message_was_taken():
    network, _ = network_of(replace(QUICK, answer_loss=1.0))
    async with served(network) as url:
        with pytest.raises(httpx.RemoteProtocolError):
            await asked(url, data="61")
    assert len(network.waiting(IMEI)) == 1


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        (b"nonsense\r\n\r\n", b"400"),
        (b"POST /rockblock/MT HTTP/1.1\r\nContent-Length: -1\r\n\r\n", b"400"),
        (b"POST /rockblock/MT HTTP/1.1\r\nContent-Length: 999999\r\n\r\n", b"413"),
        (b"POST /rockblock/MT HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n", b"411"),
        (b"POST /" + b"x" * 40000 + b" HTTP/1.1\r\n\r\n", b"431"),
        (b"POST http://[ HTTP/1.1\r\n\r\n", b"400"),
    ],
)
async def test_what_is_no_request_is_answered_and_the_next_one_is_served(sent, status):
    network, _ = network_of()
    async with served(network) as url:
        port = int(url.split(":")[2].split("/")[0])
        async with connected(port) as (reader, writer):
            writer.write(sent)
            assert (await reader.readline()).split()[1] == status
        assert await asked(url, data="61") == "OK,1"


async def test_hanging_connections_do_not_keep_the_gateway_open():
    network, _ = network_of()
    async with AsyncExitStack() as client, served(network) as url:
        port = int(url.split(":")[2].split("/")[0])
        _, writer = await client.enter_async_context(connected(port))
        writer.write(b"POST /rockblock")
        await asyncio.sleep(0.02)


async def test_port_can_be_taken_again_at_once():
    network, _ = network_of()
    gateway = RockBlockGateway(network, KEY, None)
    async with gateway.serve() as url:
        port = int(url.split(":")[2].split("/")[0])
        await asked(url, data="61")
    async with gateway.serve(port=port) as url:
        assert await asked(url, data="61") == "OK,2"


async def test_gateway_serves_this_machine_only():
    network, _ = network_of()
    with pytest.raises(ValueError, match="this machine only"):
        async with RockBlockGateway(network, KEY, None).serve("0.0.0.0"):
            pass
    with pytest.raises(ValueError, match="this machine only"):
        RockBlockGateway(network, KEY, "https://example.org/push")
    for wrong in ("ftp://127.0.0.1/push", "http://127.0.0.1:99999/push"):
        with pytest.raises(ValueError, match="http://host:port/path"):
            RockBlockGateway(network, KEY, wrong)


# ---- from a modem ---------------------------------------------------------------------------


@pytest.mark.parametrize("as_json", [False, True])
async def test_push_is_signed_and_repeats_what_is_signed(as_json: bool):
    network, _ = network_of(clock=HandClock())
    async with http_peer([TAKEN]) as customer:
        shown = "json" if as_json else "form"
        gateway = RockBlockGateway(network, KEY, customer.url + "/push", push_format=shown)
        async with gateway.serve():
            await network.session(IMEI, b"up\x00", Place(42.7, -84.5))
            await until(lambda: gateway.pusher.delivered)
    (request,) = customer.requests
    assert request.line == "POST /push HTTP/1.1"
    if as_json:
        body = json.loads(request.body)
    else:
        body = {name: values[0] for name, values in parse_qs(request.body.decode()).items()}
    claims = jwt.decode(
        body.pop("JWT"),
        load_pem_public_key(public_pem(KEY).encode()),
        algorithms=["RS256"],
        options={"verify_iat": False},
    )
    assert claims.pop("iss") == "Rock 7"
    assert isinstance(claims.pop("iat"), int)
    assert {name: str(value) for name, value in body.items()} == claims
    assert (claims["imei"], claims["momsn"], claims["data"]) == (IMEI, "0", "757000")
    sent_at = datetime.strptime(claims["transmit_time"], "%y-%m-%d %H:%M:%S").replace(tzinfo=UTC)
    assert sent_at == network.clock.now()
    assert abs(float(claims["iridium_latitude"]) - 42.7) < 0.2
    assert isinstance(body["momsn"], int if as_json else str)


async def test_push_is_repeated_until_it_is_answered_200():
    network, _ = network_of()
    async with http_peer([(500, ""), (403, ""), (302, ""), TAKEN]) as customer:
        gateway = RockBlockGateway(network, KEY, customer.url)
        async with gateway.serve():
            await network.session(IMEI, b"up")
            await until(lambda: gateway.pusher.delivered)
    assert len(customer.requests) == 4
    assert gateway.pusher.waiting == 0


async def test_push_waits_for_a_customer_and_for_the_end_of_an_outage():
    network, _ = network_of(replace(QUICK, gateway_outage=True))
    gateway = RockBlockGateway(network, KEY, None)
    async with http_peer([TAKEN]) as customer, gateway.serve() as url:
        assert await status_of(url) == 503
        await network.session(IMEI, b"up")
        await until(lambda: gateway.pusher.waiting)
        gateway.webhook.point_to(customer.url)
        await asyncio.sleep(0.1)
        assert customer.requests == []
        network.conditions = QUICK
        await until(lambda: gateway.pusher.delivered)


async def status_of(url: str) -> int:
    async with httpx.AsyncClient(trust_env=False, timeout=60.0) as client:
        return (await client.post(url, data=LOGIN)).status_code


async def test_duplicated_push_says_the_same():
    network, _ = network_of(replace(QUICK, duplication=1.0))
    async with http_peer([TAKEN] * 2) as customer:
        gateway = RockBlockGateway(network, KEY, customer.url)
        async with gateway.serve():
            await network.session(IMEI, b"up")
            await until(lambda: gateway.pusher.delivered == 2)
    first, second = (parse_qs(request.body.decode()) for request in customer.requests)
    assert {**first, "JWT": ""} == {**second, "JWT": ""}


async def test_message_is_given_up_after_half_a_day():
    clock = HandClock()
    network, _ = network_of(clock=clock)
    gateway = RockBlockGateway(network, KEY, None)
    async with gateway.serve():
        await network.session(IMEI, b"up")
        await until(lambda: gateway.pusher.waiting)
        clock.advance(hours=13)
        await until(lambda: gateway.pusher.dropped == 1)
    assert gateway.pusher.waiting == 0


async def test_session_that_broke_off_is_not_pushed_but_an_empty_one_is():
    network, told = network_of(replace(QUICK, mobile_originated_loss=1.0), seed=5)
    async with http_peer([TAKEN] * 500) as customer:
        gateway = RockBlockGateway(network, KEY, customer.url)
        async with gateway.serve():
            while not any(m.session_status == 13 for m in told):
                await network.session(IMEI, b"up")
                await asyncio.sleep(0.02)
            network.conditions = QUICK
            await network.session(IMEI, None)
            expected = 1 + sum(m.session_status == 0 for m in told)
            await until(lambda: gateway.pusher.delivered == expected)
    bodies = [parse_qs(r.body.decode(), keep_blank_values=True) for r in customer.requests]
    assert bodies[-1]["data"] == [""]
    assert {body["iridium_session_status"][0] for body in bodies} == {"0"}


# ---- with the station's own client ------------------------------------------------------------


async def test_station_sends_through_it_and_reads_what_it_pushes():
    network, _ = network_of()
    async with (
        http_peer([TAKEN]) as customer,
        RockBlockGateway(network, KEY, customer.url).serve() as url,
    ):
        client = rockblock.RockBlockGateway(url, "fleet", "word")
        taken = await client.send(IMEI, bytes(270), client_id=1)
        assert taken.message_id == "1"
        await asyncio.sleep(0.02)
        result = await network.session(IMEI, b"up", Place(42.7, -84.5))
        assert result.mt_data == bytes(270)
        await until(lambda: customer.requests)
        await client.close()
    (request,) = customer.requests
    form = "application/x-www-form-urlencoded"
    read = rockblock.read_push(request.body, form, KEY.public_key(), datetime.now(UTC))
    assert (read.imei, read.momsn, read.data) == (IMEI, 0, b"up")


async def test_station_tells_refusal_from_outage():
    network, _ = network_of()
    async with served(network) as url:
        wrong = rockblock.RockBlockGateway(url, "fleet", "wrong")
        with pytest.raises(GatewayRefusal) as refusal:
            await wrong.send(IMEI, b"x", client_id=1)
        assert refusal.value.fault is GatewayFault.LOGIN
        client = rockblock.RockBlockGateway(url, "fleet", "word")
        for trouble in ("gateway_outage", "answer_loss", "gateway_failure"):
            network.conditions = replace(QUICK, **{trouble: 1.0})
            with pytest.raises(GatewayUnreachableError):
                await client.send(IMEI, b"x", client_id=1)
        await wrong.close()
        await client.close()


# ---- with somebody else's -----------------------------------------------------------------------


async def test_rockblock_tools_sends_and_raises_each_failure(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("NO_PROXY", "*")
    network, _ = network_of()
    subscriber = network.subscriber(IMEI)

    async def send(data: bytes = b"hello", imei: str = IMEI, password: str = "word") -> int:
        arguments = (imei, "fleet", password, data)
        return await asyncio.to_thread(rockblock_tools.send, *arguments, url=url)

    async with served(network) as url, asyncio.timeout(60.0):
        assert await send(bytes(range(256))) == 1
        for code, arguments in (
            (10, {"password": "wrong"}),
            (11, {"imei": "300234010000000"}),
            (15, {"data": bytes(271)}),
            (16, {"data": b""}),
        ):
            with pytest.raises(ApiException, match=f"error code {code}:"):
                await send(**arguments)
        subscriber.account.credits_left = 0
        with pytest.raises(ApiException, match="error code 13:"):
            await send()
    assert [m.data for m in network.waiting(IMEI)] == [bytes(range(256))]


@pytest.mark.process
async def test_rockblock_tools_listener_takes_our_form():
    """Its reading of the date is not checked: it takes the year for the day."""
    port = free_port()
    command = (sys.executable, "-W", "ignore", "-c", LISTENER, str(port))
    listener = await asyncio.create_subprocess_exec(
        *command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    network, _ = network_of()
    gateway = RockBlockGateway(network, KEY, f"http://127.0.0.1:{port}/")
    try:
        async with gateway.serve(), asyncio.timeout(60.0):
            await network.session(IMEI, b"hello", Place(42.7, -84.5))
            line = b""
            while not line.startswith(IMEI.encode()):
                line = await listener.stdout.readline()
    finally:
        listener.kill()
        await listener.communicate()
    imei, momsn, data, _, latitude = line.decode().split()
    assert (imei, momsn, data) == (IMEI, "0", b"hello".hex())
    assert abs(float(latitude) - 42.7) < 0.2
