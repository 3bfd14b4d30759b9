"""Cloudloop: the Lingo that it pushes, and its answers."""

import base64
import json
import logging
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from random import Random
from urllib.parse import parse_qs

import pytest

from robot_link.station.gateway.cloudloop import CloudloopGateway, read_push
from robot_link.station.gateway.gateway import (
    GatewayFault,
    GatewayRefusal,
    GatewayUnreachableError,
    Taken,
)
from robot_link.station.gateway.push import PushRefusal
from tests.robot_link.http_peer import http_peer

NOW = datetime(2026, 11, 21, 10, 2, 5, tzinfo=UTC)
IMEI = "300234065366010"
THING = "DgXeoxwVPMyrdOBJeEGlqKRJLbajQkzZ"
TOKEN = "f7ba9e62-50c9"


def lingo(**changed):
    document = {
        "id": "fb1f8a90-cb47-4795-b11e-f5b804edf310",
        "receivedAt": {
            "year": 2023,
            "month": 10,
            "day": 18,
            "hour": 12,
            "minute": 26,
            "second": 10,
        },
        "identity": {
            "accountId": "a",
            "subscriber": {"id": "b", "type": "SUBSCRIBER_TYPE_SBD"},
            "hardware": {"id": "c", "type": "HARDWARE_TYPE_ROCKBLOCK", "imei": IMEI},
            "identifier": IMEI,
            "thingId": THING,
        },
        "sbd": {
            "imei": IMEI,
            "cdrReference": "3301853709",
            "momsn": 5394,
            "mtmsn": 0,
            "sessionAt": {"year": 2023, "month": 10, "day": 18, "hour": 12, "second": 9},
            "status": "SESSION_STATUS_OK",
            "location": {"latitude": 50.89813, "longitude": -1.19466, "cep": 4.0},
        },
        "message": base64.b64encode(b"Hello").decode(),
        "signature": "",
    }
    return document | changed


def read(document):
    return read_push(json.dumps(document).encode(), NOW)


def test_a_lingo_of_an_sbd_session_is_read():
    message = read(lingo())
    assert (message.carrier, message.imei, message.momsn) == ("cloudloop", IMEI, 5394)
    assert (message.mtmsn, message.session_status, message.data) == (None, 0, b"Hello")
    assert message.session_at == datetime(2023, 10, 18, 12, 0, 9, tzinfo=UTC)
    assert (message.latitude_deg, message.longitude_deg, message.cep_km) == (50.89813, -1.19466, 4)


def test_the_session_may_stand_below_a_header_and_lack_its_own_time():
    document = lingo()
    sbd = document.pop("sbd") | {"mtmsn": 12}
    del sbd["sessionAt"]
    message = read(document | {"header": {"sbd": sbd}})
    assert message.mtmsn == 12
    assert message.session_at == datetime(2023, 10, 18, 12, 26, 10, tzinfo=UTC)


@pytest.mark.parametrize("size", range(8))
def test_padding_of_the_message_may_lack(size):
    data = bytes(range(size))
    text = base64.b64encode(data).decode()
    for given in (text, text.rstrip("=")):
        assert read(lingo(message=given)).data == data


def test_a_message_that_is_no_base64_is_kept_raw_and_says_so():
    for text in ("A", "****", "é", "AAAA A"):
        message = read(lingo(message=text))
        assert (message.data, message.fault) == (text.encode(), "the message is not base64")
    assert read(lingo(message=None)).data == b""
    assert "340" in read(lingo(message=base64.b64encode(bytes(400)).decode())).fault


def test_pushes_that_tell_of_no_modem_or_of_two_are_refused():
    other = lingo()["sbd"] | {"imei": "300234065366011"}
    nameless = lingo(identity={})
    nameless["sbd"] = {k: v for k, v in nameless["sbd"].items() if k != "imei"}
    wrong_time = lingo()["sbd"] | {"sessionAt": {"year": 2023, "month": 2, "day": 30}}
    cases = (
        lingo(sbd=other),
        nameless,
        lingo(sbd={}),
        lingo(sbd=wrong_time),
        lingo(sbd=lingo()["sbd"] | {"momsn": 70000}),
        [],
        "text",
    )
    for document in cases:
        with pytest.raises(PushRefusal) as found:
            read(document)
        assert found.value.reason == "malformed"


def test_garbage_and_flipped_bits_never_do_more_than_be_refused():
    random = Random(13)
    good = json.dumps(lingo()).encode()
    refused = 0
    for i in range(1500):
        body = random.randbytes(random.randrange(300))
        if i % 2:
            flipped = bytearray(good)
            flipped[random.randrange(len(good))] ^= 1 << random.randrange(8)
            body = bytes(flipped)
        try:
            assert read_push(body, NOW).carrier == "cloudloop"
        except PushRefusal:
            refused += 1
    for body in (b"[" * 8000, b'{"sbd":' * 1000, b'{"sbd":{"momsn":' + b"1" * 5000 + b"}}"):
        with pytest.raises(PushRefusal):
            read_push(body, NOW)
    assert refused > 750


@asynccontextmanager
async def cloudloop(answers):
    async def thing_of(imei):
        return THING if imei == IMEI else None

    async with http_peer(answers) as peer:
        total_s = 0.3 if None in answers else 60.0
        gateway = CloudloopGateway(f"{peer.url}/Data/DoSendSbdMessage", TOKEN, thing_of, total_s)
        try:
            yield gateway, peer
        finally:
            await gateway.close()


async def test_a_message_is_posted_to_the_thing_with_the_token_in_the_body_alone(caplog):
    caplog.set_level(logging.DEBUG)
    async with cloudloop([(200, '{"id": "MT1"}')]) as (gateway, peer):
        assert await gateway.send(IMEI, b"\x01\xfe", client_id=3) == Taken("MT1", None, None)
    (request,) = peer.requests
    assert parse_qs(request.body.decode()) == {
        "token": [TOKEN],
        "thing": [THING],
        "message": ["01fe"],
    }
    assert TOKEN not in request.head
    assert TOKEN not in caplog.text


@pytest.mark.parametrize(
    ("answer", "fault", "retry"),
    [
        ((401, ""), GatewayFault.LOGIN, "never"),
        ((403, ""), GatewayFault.LOGIN, "never"),
        ((404, ""), GatewayFault.UNKNOWN_IMEI, "never"),
        ((402, ""), GatewayFault.NO_CREDIT, "never"),
        ((429, ""), GatewayFault.BUSY, "later"),
        ((200, f'{{"error": "no {TOKEN}"}}'), GatewayFault.OTHER, "never"),
        ((200, "[]"), GatewayFault.PROTOCOL, "never"),
        ((302, ""), GatewayFault.PROTOCOL, "never"),
    ],
)
async def test_each_refusal_is_typed_and_told_in_a_sentence(answer, fault, retry):
    async with cloudloop([answer]) as (gateway, _):
        with pytest.raises(GatewayRefusal) as found:
            await gateway.send(IMEI, b"x", client_id=1)
    assert (found.value.fault, found.value.retry) == (fault, retry)
    assert found.value.sentence.endswith(".")
    assert TOKEN not in found.value.sentence


@pytest.mark.parametrize("answer", [(500, ""), None])
async def test_failures_of_the_service_and_silence_are_to_be_tried_again(answer):
    async with cloudloop([answer]) as (gateway, _):
        with pytest.raises(GatewayUnreachableError):
            await gateway.send(IMEI, b"x", client_id=1)


async def test_an_unknown_modem_and_a_wrong_length_are_refused_before_any_network():
    async with cloudloop([]) as (gateway, peer):
        with pytest.raises(GatewayRefusal, match="thing"):
            await gateway.send("300234065366011", b"x", client_id=1)
        with pytest.raises(ValueError, match="270 bytes"):
            await gateway.send(IMEI, bytes(271), client_id=1)
    assert peer.requests == []
