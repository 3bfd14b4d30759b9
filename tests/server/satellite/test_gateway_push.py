"""What satellite gateways push: who gets in, what is kept, and what nobody is ever told."""

import asyncio
import base64
import json
import logging
import re
import socket

import httpx
import pytest

from db.fault import StoreUnavailableError
from db.query.fleet.robots import add_robot
from db.query.station.events import newest_events
from robot_link.station.gateway.gateway import HeldBackError
from server.access.rate import RateLimit
from server.base.secret import GatewayAccount
from server.base.settings import Settings
from tests.robot_link.signed_push import (
    FORM,
    IMEI,
    JSON,
    confused_token,
    form_push,
    json_push,
    private_key,
    public_pem,
    push_fields,
    token_of,
    unsigned_token,
)
from tests.robot_link.test_directip import CAPTURE, deliver
from tests.server.gateway_station import (
    PASSWORD,
    _tables,
    blank_database,
    keeper_of,
    robot,
    station,
)
from tests.server.station_app import client_of, signed_in

CLOUDLOOP_IMEI = "300234065366010"
__all__ = ["_tables", "blank_database"]


@pytest.fixture
async def app(tmp_path):
    async with station(tmp_path) as app:
        yield app


@pytest.fixture
async def gateway(app):
    async with client_of(app) as client:
        yield client


async def until(condition):
    async with asyncio.timeout(60):
        while True:
            if condition():
                return
            await asyncio.sleep(0.005)


def push_path(app, kind="rockblock"):
    return f"/api/gateways/{kind}/push/{app.state.foundation.secrets.push_path(kind)}"


async def push(app, client, body, kind=FORM, **headers):
    return await client.post(
        push_path(app), content=body, headers={"Content-Type": kind, **headers}
    )


def traffic(app, kind="rockblock"):
    return keeper_of(app).gateways.traffic[kind]


async def events(app, kind):
    found = await app.state.foundation.store.query(newest_events)
    return [event for event in found if event.kind == kind]


def alarms_standing(app):
    return [a.cause for a in app.state.foundation.alarms.open if a.cleared_at is None]


async def test_a_delivery_from_a_network_that_is_not_allowed_raises_an_alarm(tmp_path):
    settings = {"directip_port": 0, "directip_allowed": ("192.0.2.0/24",)}
    async with station(tmp_path, **settings) as app:
        gateways = keeper_of(app).gateways
        await until(lambda: gateways.directip_port is not None)
        await deliver(gateways.directip_port, CAPTURE)
        await until(lambda: alarms_standing(app) == ["forged:directip"])
        assert keeper_of(app).messages == []


@pytest.mark.parametrize(("body", "kind"), [(form_push(), FORM), (json_push(), JSON)])
async def test_a_signed_push_is_kept_before_it_is_answered(app, gateway, body, kind):
    answer = await push(app, gateway, body, kind)
    assert (answer.status_code, answer.json()) == (200, {"is_new": True})
    (message,) = keeper_of(app).messages
    assert (message.imei, message.data, message.momsn) == (IMEI, b"Hello", 66)
    assert traffic(app).accepted == 1


async def test_a_repeated_push_is_answered_and_adds_no_row(app, gateway):
    body = json_push()
    answers = [await push(app, gateway, body, JSON) for _ in range(3)]
    assert [answer.status_code for answer in answers] == [200, 200, 200]
    assert [answer.json()["is_new"] for answer in answers] == [True, False, False]
    assert (traffic(app).accepted, traffic(app).duplicate) == (1, 2)


async def test_the_same_number_in_another_session_is_another_message(app, gateway):
    for time in ("26-11-21 10:02:03", "26-11-21 11:02:03"):
        assert (await push(app, gateway, form_push(push_fields(transmit_time=time)))).json()[
            "is_new"
        ]


async def test_a_push_needs_neither_cookie_nor_origin_and_no_page_can_stop_it(app, gateway):
    answer = await push(app, gateway, form_push(), Origin="https://evil.example")
    assert answer.status_code == 200


def test_directip_is_open_to_other_machines_only_for_networks_that_are_named(tmp_path):
    far = {"data_dir": tmp_path, "directip_port": 10800, "directip_host": "0.0.0.0"}
    with pytest.raises(ValueError, match="give directip_allowed the networks"):
        Settings(**far)
    assert Settings(**far, directip_allowed=("192.0.2.0/24",)).directip_port == 10800
    assert Settings(**{**far, "directip_host": "127.0.0.1"}).directip_port == 10800


async def test_without_the_secret_path_there_is_nothing(app, gateway):
    for word in ("x", "rockblock", "é", app.state.foundation.secrets.push_path("cloudloop")):
        answer = await gateway.post(f"/api/gateways/rockblock/push/{word}", content=form_push())
        assert answer.status_code == 404
    assert keeper_of(app).messages == []
    assert traffic(app).refused == {"bad_path": 4}


async def test_forged_pushes_are_refused_counted_and_told_once(app, gateway):
    fields = push_fields()
    good = token_of(fields)
    forged = [
        form_push(fields, unsigned_token(fields)),
        form_push(fields, confused_token(fields, public_pem())),
        form_push(fields, token_of(fields, private_key(2048, 1))),
        form_push(fields, good[:-8] + "AAAAAAAA"),
        form_push(push_fields(data="00"), good),
        json_push(push_fields(momsn=67), good),
    ]
    for body in forged:
        answer = await push(app, gateway, body, JSON if body.startswith(b"{") else FORM)
        assert answer.status_code == 403
    assert traffic(app).refused == {"signature": 4, "disagrees": 2}
    assert keeper_of(app).messages == []
    assert len(await events(app, "gateway.refused")) == 2
    [alarm] = app.state.foundation.alarms.open
    assert "RockBLOCK's name that it did not sign" in alarm.text
    assert (alarm.cause, alarm.cleared_at) == ("forged:rockblock", None)
    assert (await push(app, gateway, form_push())).status_code == 200
    assert alarms_standing(app) == []


async def test_without_a_key_nothing_is_believed(app, gateway):
    account = GatewayAccount(url="https://rockblock.example/MT")
    app.state.foundation.secrets.set_gateway("rockblock", account)
    assert (await push(app, gateway, form_push())).status_code == 403
    assert traffic(app).refused == {"no_key": 1}


async def test_a_push_that_is_too_large_is_refused_whatever_it_says_of_its_length(app, gateway):
    async def pieces():
        for _ in range(9):
            yield b"x" * 1024

    assert (await push(app, gateway, b"x" * 8193)).status_code == 413
    assert (await push(app, gateway, pieces())).status_code == 413
    assert (await push(app, gateway, b"x" * 8192)).status_code == 403
    assert traffic(app).refused == {"too_large": 2, "signature": 1}


async def test_a_push_whose_sender_hangs_up_in_the_middle_is_refused_and_counted(app, caplog):
    path = push_path(app)
    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": "POST",
        "scheme": "http",
        "path": path,
        "raw_path": path.encode(),
        "query_string": b"",
        "headers": [(b"host", b"127.0.0.1:8000"), (b"content-type", FORM.encode())],
        "client": ("127.0.0.1", 5000),
        "server": ("127.0.0.1", 80),
        "root_path": "",
    }
    came = [{"type": "http.request", "body": b"imei=", "more_body": True}]

    async def receive():
        return came.pop() if came else {"type": "http.disconnect"}

    answers = []

    async def send(message):
        answers.append(message)

    await app(scope, receive, send)
    assert answers[0]["status"] == 400
    assert traffic(app).refused == {"malformed": 1}
    assert "Traceback" not in caplog.text


async def test_pushes_that_come_too_often_are_asked_to_come_later(app, gateway):
    keeper_of(app).gateways.limits["rockblock"] = RateLimit(2, 1e-6)
    statuses = [(await push(app, gateway, form_push())).status_code for _ in range(4)]
    assert statuses == [200, 200, 429, 429]
    assert (await push(app, gateway, form_push())).headers["Retry-After"] == "5"
    assert traffic(app).refused == {"too_often": 3}


async def test_whoever_lacks_the_path_cannot_keep_the_gateway_out(app, gateway):
    keeper_of(app).gateways.limits["rockblock"] = RateLimit(1, 1e-6)
    for _ in range(5):
        await gateway.post("/api/gateways/rockblock/push/x", content=form_push())
    assert (await push(app, gateway, form_push())).status_code == 200


async def test_a_payload_that_cannot_be_read_is_kept_raw_and_flagged(app, gateway):
    answer = await push(app, gateway, form_push(push_fields(data="no hex")))
    assert answer.status_code == 200
    (message,) = keeper_of(app).messages
    assert (message.data, bool(message.fault)) == (b"no hex", True)


async def test_an_empty_payload_is_a_message(app, gateway):
    assert (await push(app, gateway, form_push(push_fields(data="")))).json() == {"is_new": True}


async def test_a_push_that_could_not_be_kept_is_pushed_again(app, gateway):
    keeper = keeper_of(app)
    for fault in (HeldBackError("The link is unplugged."), StoreUnavailableError("disk full")):
        keeper.fault = fault
        answer = await push(app, gateway, form_push())
        assert answer.status_code == 503
        assert int(answer.headers["Retry-After"]) > 0
    keeper.fault = None
    assert (await push(app, gateway, form_push())).json() == {"is_new": True}
    assert traffic(app).refused == {"held_back": 1, "not_kept": 1}


async def test_a_modem_that_no_robot_has_is_told_of_once(app, gateway):
    for momsn in (1, 2):
        await push(app, gateway, form_push(push_fields(momsn=momsn)))
    (event,) = await events(app, "gateway.unknown_imei")
    assert IMEI in event.text
    assert len(keeper_of(app).messages) == 2


async def test_a_modem_that_a_robot_has_is_no_stranger(app, gateway):
    await app.state.foundation.store.write(
        lambda session: add_robot(session, robot(links=(f"rockblock://{IMEI}",)))
    )
    await push(app, gateway, form_push())
    assert await events(app, "gateway.unknown_imei") == []


async def test_cloudloop_pushes_to_its_own_path(app, gateway):
    lingo = {
        "receivedAt": {"year": 2026, "month": 11, "day": 21},
        "sbd": {"imei": CLOUDLOOP_IMEI, "momsn": 3, "status": "SESSION_STATUS_OK"},
        "message": base64.b64encode(b"Hello").decode().rstrip("="),
    }
    path = push_path(app, "cloudloop")
    for is_new in (True, False):
        answer = await gateway.post(path, json=lingo)
        assert (answer.status_code, answer.json()) == (200, {"is_new": is_new})
    assert (await gateway.post(path, content=b"[]")).status_code == 400
    assert traffic(app, "cloudloop").refused == {"malformed": 1}
    (message, _) = keeper_of(app).messages
    assert (message.imei, message.data) == (CLOUDLOOP_IMEI, b"Hello")


async def test_directip_messages_come_by_their_own_port_and_are_confirmed(tmp_path):
    async with station(tmp_path, directip_port=0) as app:
        gateways = keeper_of(app).gateways
        await gateways.set_account(
            "directip", GatewayAccount(url="tcp://127.0.0.1:1", confirms=True)
        )
        await until(lambda: gateways.directip_port)
        for _ in range(2):
            assert await deliver(gateways.directip_port, CAPTURE) == b"\x01\0\x04\x05\0\x01\x01"
        assert await deliver(gateways.directip_port, CAPTURE + b"x") == b"\x01\0\x04\x05\0\x01\0"
    directip = gateways.traffic["directip"]
    assert (directip.accepted, directip.duplicate) == (1, 1)
    assert directip.refused == {"malformed": 1}


async def test_directip_messages_that_come_too_often_are_left_with_the_gateway(tmp_path):
    async with station(tmp_path, directip_port=0) as app:
        gateways = keeper_of(app).gateways
        gateways.limits["directip"] = RateLimit(1, 1e-6)
        await until(lambda: gateways.directip_port)
        for _ in range(3):
            assert await deliver(gateways.directip_port, CAPTURE) == b""
    assert len(keeper_of(app).messages) == 1
    assert gateways.traffic["directip"].refused == {"too_often": 2, "not_kept": 2}


async def test_a_directip_port_that_is_taken_is_told_as_an_alarm(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        async with station(tmp_path, directip_port=port) as app:
            alarms = app.state.foundation.alarms
            await until(lambda: alarms.open)
            assert f"127.0.0.1:{port} cannot be listened on" in alarms.open[0].text
            assert keeper_of(app).gateways.directip_port is None


async def test_nothing_secret_is_told_logged_or_put_into_an_event(app, gateway, caplog):
    caplog.set_level(logging.DEBUG)
    secrets = app.state.foundation.secrets
    word, key = secrets.push_path("rockblock"), secrets.robot_key("grace-1").hex()
    told = []
    async with signed_in(app) as admin:
        body = {"password": "an0ther-word", "public_key": public_pem()}
        told.append((await admin.put("/api/gateways/rockblock", json=body)).text)
        told.append((await admin.get("/api/gateways")).text)
        told.append((await admin.get("/api/events")).text)
        keeper_of(app).fault = RuntimeError("broken")
        assert (await push(app, gateway, form_push())).status_code == 500
        told.append((await push(app, gateway, b"rubbish")).text)
        told.append((await gateway.post(push_path(app) + "x")).text)
        shown = json.loads(told[1])["gateways"][0]["push_url"]
    told.append(repr(secrets.gateway("rockblock")))
    everything = "\n".join(told)
    for secret in (PASSWORD, "an0ther-word", key, private_material()):
        assert secret not in everything
        assert secret not in caplog.text
    assert shown.endswith(f"/push/{word}")  # the administrator enters it at the gateway
    logged = [r.getMessage() for r in caplog.records if not r.name.startswith("httpx")]
    assert word not in "\n".join(logged)  # httpx is the test's own client
    assert re.search(r"push/\{secret\} failed", "\n".join(logged))


def private_material():
    return f"{private_key().private_numbers().d:x}"


async def test_the_address_of_pushes_is_the_one_that_gateways_can_reach(tmp_path):
    public = "https://station.example.org/"
    async with station(tmp_path, gateway_public_url=public) as app, signed_in(app) as admin:
        shown = (await admin.get("/api/gateways")).json()["gateways"]
        assert shown[0]["push_url"].startswith("https://station.example.org/api/gateways/rockblock")
        async with httpx.AsyncClient(
            transport=httpx.ASGITransport(app), base_url="http://station.example.org"
        ) as outside:
            assert (await outside.post(push_path(app), content=form_push())).status_code == 200
    assert shown[1]["push_url"] is None
