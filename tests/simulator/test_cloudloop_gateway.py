import asyncio
import base64
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from datetime import UTC, datetime

import httpx
import pytest

from robot_link.station.gateway import cloudloop
from robot_link.station.gateway.gateway import GatewayFault, GatewayRefusal, GatewayUnreachableError
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.session import Place
from tests.robot_link.http_peer import http_peer
from tests.robot_link.rig import until
from tests.simulator.cloudloop_gateway import CloudloopGateway
from tests.simulator.iridium import IMEI, QUICK, HandClock, network_of

CALL = {"token": "word", "thing": "thing-1", "message": "646f776e"}
TAKEN = (200, "")


@asynccontextmanager
async def served(network: IridiumNetwork) -> AsyncIterator[str]:
    async with CloudloopGateway(network, None).serve() as url:
        yield url


async def asked(url: str, fields: dict[str, str], **options) -> httpx.Response:
    async with httpx.AsyncClient(trust_env=False, timeout=60.0) as client:
        return await client.post(url, data=fields, **options)


async def test_message_is_queued_and_named():
    network, _ = network_of(carrier="cloudloop")
    async with served(network) as url:
        first = await asked(url, CALL)
        second = await asked(url, CALL)
    assert first.status_code == 200
    assert len(first.json()["id"]) == 32
    assert first.json() != second.json()
    assert [m.data for m in network.waiting(IMEI)] == [b"down"] * 2
    assert network.credits_charged[IMEI] == 2


async def test_call_may_stand_in_the_query_and_the_token_in_a_header():
    network, _ = network_of(carrier="cloudloop")
    bare = {name: value for name, value in CALL.items() if name != "token"}
    async with served(network) as url, httpx.AsyncClient(trust_env=False, timeout=60.0) as client:
        assert (await client.get(url, params=CALL)).status_code == 200
        bearer = {"Authorization": "Bearer word"}
        assert (await asked(url, bare, headers=bearer)).status_code == 200
        assert (await asked(url, bare)).status_code == 401
        assert (await client.delete(url)).status_code == 405
        assert (await client.get(url + "x")).status_code == 404


@pytest.mark.parametrize(
    ("wrong", "status"),
    [
        ({"token": "stolen"}, 401),
        ({"thing": "somebody-elses"}, 404),
        ({"message": "6"}, 400),
        ({"message": ""}, 400),
        ({"message": "00" * 271}, 400),
    ],
)
async def test_each_fault_of_the_customer_is_told(wrong: dict[str, str], status: int):
    network, _ = network_of(carrier="cloudloop")
    async with served(network) as url:
        answer = await asked(url, CALL | wrong)
    assert answer.status_code == status
    assert answer.json()["error"]
    assert network.waiting(IMEI) == ()


async def test_contract_credit_and_the_service_itself_can_fail():
    network, _ = network_of(carrier="cloudloop")
    subscriber = network.subscriber(IMEI)
    async with served(network) as url:
        subscriber.account.credits_left = 0
        assert (await asked(url, CALL)).status_code == 402
        subscriber.account.credits_left = None
        subscriber.has_line_rental = False
        assert (await asked(url, CALL)).status_code == 409
        network.conditions = replace(QUICK, gateway_failure=1.0)
        assert (await asked(url, CALL)).status_code == 500


async def test_push_is_a_lingo_message_and_is_repeated_until_it_is_taken():
    network, told = network_of(clock=HandClock(), carrier="cloudloop")
    async with http_peer([(500, ""), *[TAKEN] * 3]) as customer:
        gateway = CloudloopGateway(network, customer.url + "/push")
        async with gateway.serve():
            await network.session(IMEI, b"up", Place(42.7, -84.5))
            network.clock.advance(seconds=30)
            await until(lambda: gateway.pusher.waiting)
            await until(lambda: network.clock.advance(seconds=1) or gateway.pusher.delivered)
    first, second = (json.loads(request.body) for request in customer.requests)
    assert first["id"] == second["id"]
    body = first
    assert base64.b64decode(body["message"].rstrip("=") + "=") == b"up"
    assert body["identity"]["thingId"] == "thing-1"
    assert body["identity"]["hardware"]["imei"] == IMEI
    assert (body["sbd"]["momsn"], body["sbd"]["mtmsn"]) == (0, 0)
    assert body["sbd"]["location"]["latitude"] == told[0].latitude_deg
    at = body["sbd"]["sessionAt"]
    assert datetime(**at, tzinfo=UTC) == told[0].session_at


async def test_padding_lacks_now_and_then():
    network, _ = network_of(carrier="cloudloop")
    async with http_peer([TAKEN] * 12) as customer:
        gateway = CloudloopGateway(network, customer.url)
        async with gateway.serve():
            for _ in range(12):
                await network.session(IMEI, b"pad!")
            await until(lambda: gateway.pusher.delivered == 12)
    texts = {json.loads(request.body)["message"] for request in customer.requests}
    assert texts == {"cGFkIQ==", "cGFkIQ"}


async def test_station_sends_through_it_and_reads_what_it_pushes():
    network, _ = network_of(carrier="cloudloop")

    async def thing_of(_imei: str) -> str:
        return "thing-1"

    async with (
        http_peer([TAKEN]) as customer,
        CloudloopGateway(network, customer.url).serve() as url,
    ):
        client = cloudloop.CloudloopGateway(url, "word", thing_of)
        assert len((await client.send(IMEI, bytes(270), client_id=1)).message_id) == 32
        await asyncio.sleep(0.02)
        assert (await network.session(IMEI, b"up")).mt_data == bytes(270)
        await until(lambda: customer.requests)
        for trouble in ("gateway_outage", "answer_loss", "gateway_failure"):
            network.conditions = replace(QUICK, **{trouble: 1.0})
            with pytest.raises(GatewayUnreachableError):
                await client.send(IMEI, b"x", client_id=1)
        wrong = cloudloop.CloudloopGateway(url, "stolen", thing_of)
        network.conditions = QUICK
        with pytest.raises(GatewayRefusal) as refusal:
            await wrong.send(IMEI, b"x", client_id=1)
        assert refusal.value.fault is GatewayFault.LOGIN
        await client.close()
        await wrong.close()
    (request,) = customer.requests
    read = cloudloop.read_push(request.body, datetime.now(UTC))
    assert (read.imei, read.momsn, read.mtmsn, read.data) == (IMEI, 0, 1, b"up")
