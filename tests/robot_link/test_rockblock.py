"""RockBLOCK: what it pushes is believed only if it is signed, and what it answers is understood."""

import asyncio
import json
import logging
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path
from random import Random
from urllib.parse import parse_qs

import jwt
import pytest

from robot_link.station.gateway.gateway import (
    GatewayFault,
    GatewayRefusal,
    GatewayUnreachableError,
    Taken,
    retry_after_s,
)
from robot_link.station.gateway.push import PushRefusal
from robot_link.station.gateway.rockblock import RockBlockGateway, public_key_of, read_push
from tests.free_port import free_port
from tests.robot_link.http_peer import http_peer
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

NOW = datetime(2026, 11, 21, 10, 2, 5, tzinfo=UTC)
KEY = private_key().public_key()
GROUND_CONTROL = Path(__file__).parents[3] / "shared/data/groundcontrol_rs256_public.pem"
REAL_PUSH = (
    '{"momsn":193,"data":"48656c6c6f21205468697320697320612074657374206d6573736167652066726f6d2052'
    '6f636b424c4f434b21","serial":15583,"iridium_latitude":7.3758,"iridium_cep":46.0,"JWT":"eyJhbG'
    "ciOiJSUzI1NiJ9.eyJpc3MiOiJSb2NrIDciLCJpYXQiOjE1OTEyNzkxODAsImRhdGEiOiI0ODY1NmM2YzZmMjEyMDU0Nj"
    "g2OTczMjA2OTczMjA2MTIwNzQ2NTczNzQyMDZkNjU3MzczNjE2NzY1MjA2NjcyNmY2ZDIwNTI2ZjYzNmI0MjRjNGY0MzRi"
    "MjEiLCJkZXZpY2VfdHlwZSI6IlJPQ0tCTE9DSyIsImltZWkiOiIzMDAyMzQwNjc2MjI4MzAiLCJpcmlkaXVtX2NlcCI6Ij"
    "Q2LjAiLCJpcmlkaXVtX2xhdGl0dWRlIjoiNy4zNzU4IiwiaXJpZGl1bV9sb25naXR1ZGUiOiIxNjAuNjAyMyIsIm1vbXNu"
    "IjoiMTkzIiwic2VyaWFsIjoiMTU1ODMiLCJ0cmFuc21pdF90aW1lIjoiMjAtMDYtMDQgMTM6NTk6MzkifQ.NnwLu1HqcpD"
    "qER_K3NA2bGU_S7WZ9KflqTzpxHd4OrIpy5yirUR7LGELT7ZQC5T9Suyu34kZqv-e5DWpXRMebyxvEobhPEHlODH3nCO8Q"
    "y8w9_--UtF3uHjEqd6djzCau5aubt94Fl8WZ702H2QrRDcBiTA7oRVbG8y8FU7m4X4ei7RzfVLKDWYrDu_dym1OqUmk9Qee"
    "PN4np_NQuXrbt8_UggUhZazas5znu8P-kLS7kGXjuV9MT8rLprlcSwh4b2oXyit6bnzjq0tT4cZtk9gzVPODUMBEIgFLynz"
    'O16gr2-r4sJd1ECvOytQlTNnv1TIwl2upN7eH1Lh3B0NXSw","imei":"300234067622830","device_type":"ROCKBL'
    'OCK","transmit_time":"20-06-04 13:59:39","iridium_longitude":160.6023}'
)
"""A test message of Ground Control as it was pushed in 2020."""


def read(body, content_type=FORM, key=KEY):
    return read_push(body, content_type, key, NOW)


def refusal(body, content_type=FORM, key=KEY):
    with pytest.raises(PushRefusal) as found:
        read(body, content_type, key)
    return found.value.reason


@pytest.mark.parametrize(("push", "kind"), [(form_push, FORM), (json_push, JSON)])
def test_a_signed_push_is_read_as_form_and_as_json(push, kind):
    message = read(push(), kind)
    assert (message.carrier, message.imei, message.momsn) == ("rockblock", IMEI, 66)
    assert message.session_at == datetime(2026, 11, 21, 10, 2, 3, tzinfo=UTC)
    assert (message.latitude_deg, message.longitude_deg, message.cep_km) == (45.9123, -84.5567, 3.0)
    assert (message.data, message.fault, message.mtmsn) == (b"Hello", "", None)
    assert message.arrived_at == NOW


def test_the_year_stands_first_in_the_time_of_transmission():
    fields = push_fields(transmit_time="21-06-03 01:02:03")
    assert read(form_push(fields)).session_at == datetime(2021, 6, 3, 1, 2, 3, tzinfo=UTC)
    for wrong in ("2021-06-03 01:02:03", "21-13-03 01:02:03", "21-06-31 01:02:03", "", "now"):
        assert refusal(form_push(push_fields(transmit_time=wrong))) == "malformed"


def test_a_push_without_data_is_one():
    assert read(form_push(push_fields(data=""))).data == b""
    without = {name: value for name, value in push_fields().items() if name != "data"}
    assert read(json_push(without), JSON).data == b""


def test_what_is_no_hexadecimal_is_kept_raw_and_says_so():
    for text in ("48656c6c6", "zz", "48 65", "0x48"):
        message = read(form_push(push_fields(data=text)))
        assert message.data == text.encode()
        assert "hexadecimal" in message.fault
    long = read(form_push(push_fields(data="00" * 341)))
    assert (len(long.data), "340" in long.fault) == (341, True)


def test_a_push_of_ground_control_verifies_with_its_published_key():
    if not GROUND_CONTROL.exists():
        pytest.skip(f"{GROUND_CONTROL.name} is not here: Ground Control's key is not ours to ship")
    key = public_key_of(GROUND_CONTROL.read_text())
    message = read(REAL_PUSH.encode(), JSON, key)
    assert message.data == b"Hello! This is a test message from RockBLOCK!"
    assert message.session_at == datetime(2020, 6, 4, 13, 59, 39, tzinfo=UTC)
    assert (message.imei, message.momsn) == ("300234067622830", 193)
    tampered = REAL_PUSH.replace("48656c6c6f21", "48656c6c6f22", 1)
    assert refusal(tampered.encode(), JSON, key) == "disagrees"
    assert refusal(REAL_PUSH.encode(), JSON) == "signature"


def test_one_changed_character_anywhere_in_the_token_is_refused():
    token = token_of(push_fields())
    random = Random(5)
    for at in random.sample(range(len(token)), 60):
        old = token[at]
        new = random.choice([c for c in "AQgw5_" if c != old])
        changed = token[:at] + new + token[at + 1 :]
        if at == len(token) - 1:
            continue  # its last bits are padding, so another letter may mean the same bytes
        assert refusal(form_push(token=changed)) in ("signature", "disagrees")


def test_tokens_that_nobody_or_somebody_else_signed_are_refused():
    fields = push_fields()
    assert refusal(form_push(fields, unsigned_token(fields))) == "signature"
    assert refusal(form_push(fields, confused_token(fields, public_pem()))) == "signature"
    assert refusal(form_push(fields, token_of(fields, private_key(2048, 1)))) == "signature"
    assert refusal(form_push(fields, "")) == "signature"
    no_token = json.dumps(fields).encode()
    assert refusal(no_token, JSON) == "signature"


@pytest.mark.parametrize(
    ("claims", "is_taken"),
    [
        ({"exp": 3600}, True),
        ({"exp": -30}, True),
        ({"exp": -61}, False),
        ({"nbf": -10}, True),
        ({"nbf": 61}, False),
        ({"nbf": -10, "exp": -61}, False),
    ],
)
def test_a_signature_holds_only_in_the_time_that_it_says(claims, is_taken):
    """Clocks may differ by a minute."""
    times = {name: int(NOW.timestamp()) + second for name, second in claims.items()}
    body = form_push(token=token_with(**times))
    if is_taken:
        assert read(body).imei == IMEI
    else:
        assert refusal(body) == "expired"


@pytest.mark.parametrize("value", ["never", None, [], "1e999", float("nan")])
def test_a_time_of_expiry_that_is_none_is_refused(value):
    assert refusal(form_push(token=token_with(exp=value))) == "expired"


def token_with(**claims):
    """Sign also what a library would not."""
    fields = {name: str(value) for name, value in push_fields().items()}
    payload = json.dumps(fields | claims).encode()
    return jwt.PyJWS().encode(payload, private_key(), algorithm="RS256")


@pytest.mark.parametrize(
    ("field", "other"),
    [
        ("data", "48656c6c70"),
        ("imei", "300234010753371"),
        ("momsn", 67),
        ("transmit_time", "26-11-21 10:02:04"),
        ("iridium_latitude", 45.9124),
        ("serial", 1),
    ],
)
def test_a_body_that_says_other_than_what_was_signed_is_refused(field, other):
    token = token_of(push_fields())
    for push, kind in ((form_push, FORM), (json_push, JSON)):
        assert refusal(push(push_fields(**{field: other}), token), kind) == "disagrees"


def test_a_field_that_stands_twice_is_refused():
    assert refusal(form_push() + b"&momsn=67") == "malformed"
    assert refusal(json_push().replace(b'"momsn": 66', b'"momsn": 67, "momsn": 66'), JSON) == (
        "malformed"
    )


def test_a_place_that_cannot_be_does_not_cost_the_message():
    message = read(form_push(push_fields(iridium_latitude=200.0, iridium_cep=-1)))
    assert (message.latitude_deg, message.longitude_deg, message.data) == (None, None, b"Hello")


def test_wrong_numbers_of_signed_pushes_are_refused():
    for changed in ({"momsn": 65536}, {"momsn": -1}, {"imei": "12"}, {"imei": "3" * 14 + "x"}):
        assert refusal(form_push(push_fields(**changed))) == "malformed"


def test_garbage_and_flipped_bits_never_do_more_than_be_refused():
    random = Random(11)
    good = json_push()
    bodies = [random.randbytes(random.randrange(600)) for _ in range(400)]
    for _ in range(400):
        flipped = bytearray(good)
        flipped[random.randrange(len(good))] ^= 1 << random.randrange(8)
        bodies.append(bytes(flipped))
    bodies += [b"[" * 8000, b'{"a":' * 1500, b'{"JWT": 1e999}', b'{"momsn":' + b"9" * 5000 + b"}"]
    refused = 0
    for body in bodies:
        try:
            assert read(body, JSON) == read(good, JSON)  # a field that nobody reads was hit
        except PushRefusal:
            refused += 1
        with pytest.raises(PushRefusal):
            read(b"JWT=" + body, FORM)
    assert refused > 700


@pytest.mark.parametrize("pem", ["", "no key", public_pem(private_key(1024))])
def test_a_key_that_cannot_be_trusted_is_refused(pem):
    with pytest.raises(ValueError, match=r"PEM|2048"):
        public_key_of(pem)


@asynccontextmanager
async def rockblock(answers):
    """A gateway of ours before a peer that answers each request in turn."""
    async with http_peer(answers) as peer:
        total_s = 0.3 if None in answers else 60.0
        gateway = RockBlockGateway(f"{peer.url}/rockblock/MT", "ann", "s3cret-word", total_s)
        try:
            yield gateway, peer
        finally:
            await gateway.close()


async def test_a_message_is_posted_with_its_secrets_in_the_body_alone(caplog):
    caplog.set_level(logging.DEBUG)
    async with rockblock([(200, "OK,114711")]) as (gateway, peer):
        taken = await gateway.send(IMEI, b"\x00\xff", client_id=7, flush=True)
    assert taken == Taken("114711", None, None)
    (request,) = peer.requests
    assert parse_qs(request.body.decode()) == {
        "imei": [IMEI],
        "username": ["ann"],
        "password": ["s3cret-word"],
        "data": ["00ff"],
        "flush": ["yes"],
    }
    assert request.line == "POST /rockblock/MT HTTP/1.1"
    assert "s3cret-word" not in request.head
    assert "s3cret-word" not in caplog.text


@pytest.mark.parametrize(
    ("code", "fault"),
    [
        (10, GatewayFault.LOGIN),
        (11, GatewayFault.UNKNOWN_IMEI),
        (12, GatewayFault.NO_LINE_RENTAL),
        (13, GatewayFault.NO_CREDIT),
        (14, GatewayFault.BAD_DATA),
        (15, GatewayFault.TOO_LONG),
        (16, GatewayFault.EMPTY),
        (47, GatewayFault.OTHER),
    ],
)
async def test_each_code_of_a_failure_is_a_typed_refusal_with_a_sentence(code, fault):
    async with rockblock([(200, f"FAILED,{code},s3cret-word is wrong")]) as (gateway, _):
        with pytest.raises(GatewayRefusal) as found:
            await gateway.send(IMEI, b"x", client_id=1)
    assert (found.value.fault, found.value.retry) == (fault, "never")
    assert found.value.sentence.endswith(".")
    assert "s3cret" not in found.value.sentence


@pytest.mark.parametrize("answer", [(200, "FAILED,99,System error"), (503, "busy"), None])
async def test_failures_of_the_service_and_silence_are_to_be_tried_again(answer):
    async with rockblock([answer]) as (gateway, _):
        with pytest.raises(GatewayUnreachableError) as found:
            await gateway.send(IMEI, b"x", client_id=1)
    assert found.value.sentence.endswith(".")


async def test_nobody_at_the_address_is_told_in_a_sentence():
    gateway = RockBlockGateway(f"http://127.0.0.1:{free_port()}", "ann", "s3cret-word")
    with pytest.raises(GatewayUnreachableError, match="cannot be reached"):
        await gateway.send(IMEI, b"x", client_id=1)
    await gateway.close()


@pytest.mark.parametrize("url", ["https://gate\nway/", "https://\u2603.example/", "https://xn--/"])
async def test_an_address_that_is_none_is_told_in_a_sentence(url):
    gateway = RockBlockGateway(url, "ann", "s3cret-word")
    with pytest.raises(GatewayUnreachableError, match="address of RockBLOCK is none"):
        await gateway.send(IMEI, b"x", client_id=1)
    await gateway.close()


@pytest.mark.parametrize("answer", [(200, "<html>"), (302, ""), (404, "none"), (200, "OK,")])
async def test_what_is_no_answer_of_the_service_is_refused(answer):
    async with rockblock([answer]) as (gateway, peer):
        with pytest.raises(GatewayRefusal) as found:
            await gateway.send(IMEI, b"x", client_id=1)
    assert found.value.fault is GatewayFault.PROTOCOL
    assert len(peer.requests) == 1


async def test_a_service_that_has_had_enough_is_asked_again_later():
    async with rockblock([(429, "slow down")]) as (gateway, _):
        with pytest.raises(GatewayRefusal) as found:
            await gateway.send(IMEI, b"x", client_id=1)
    assert (found.value.fault, found.value.retry) == (GatewayFault.BUSY, "later")


async def test_an_endless_answer_is_cut():
    async with rockblock([(200, "OK,1," + "x" * 3_000_000)]) as (gateway, _):
        assert (await gateway.send(IMEI, b"x", client_id=1)).message_id == "1"


@pytest.mark.parametrize("size", [0, 271, 5000])
async def test_a_message_of_a_wrong_length_is_refused_before_any_network(size):
    async with rockblock([]) as (gateway, peer):
        with pytest.raises(ValueError, match="270 bytes"):
            await gateway.send(IMEI, bytes(size), client_id=1)
        for wrong in ({"imei": "1"}, {"client_id": 0}, {"priority": 6}):
            with pytest.raises(ValueError, match=r"IMEI|client id|priority"):
                await gateway.send(
                    **({"imei": IMEI, "data": b"x", "client_id": 1, "priority": 5} | wrong)
                )
    assert peer.requests == []


async def test_the_shortest_and_the_longest_message_are_sent():
    async with rockblock([(200, "OK,1"), (200, "OK,2")]) as (gateway, peer):
        for size in (1, 270):
            await gateway.send(IMEI, bytes(size), client_id=1)
    sizes = [len(bytes.fromhex(parse_qs(r.body.decode())["data"][0])) for r in peer.requests]
    assert sizes == [1, 270]


async def test_messages_may_be_handed_over_at_the_same_time():
    async with rockblock([(200, f"OK,{i}") for i in range(5)]) as (gateway, _):
        sends = (gateway.send(IMEI, b"x", client_id=i + 1) for i in range(5))
        taken = await asyncio.gather(*sends)
    assert sorted(one.message_id for one in taken) == list("01234")


def test_the_wait_after_a_failure_doubles_up_to_ten_minutes():
    waits = [retry_after_s(attempt) for attempt in (1, 2, 3, 8, 50, 10**6)]
    assert waits == [5, 10, 20, 600, 600, 600]
