"""Accounts with gateways and the keys of robots: entered, kept in private, never shown."""

import asyncio
import stat

import pytest

from db.query.fleet.robots import add_robot
from robot_link.station.gateway.gateway import GatewayFault, GatewayRefusal, Taken
from server.access.rate import RateLimit
from server.base.secret import GatewayAccount, SecretStore, SecretUnreadableError
from tests.robot_link.http_peer import http_peer
from tests.robot_link.signed_push import IMEI, public_pem
from tests.robot_link.test_directip import confirmation, gateway_saying
from tests.server.gateway_station import _tables, blank_database, keeper_of, robot, station
from tests.server.station_app import signed_in

__all__ = ["_tables", "blank_database"]


@pytest.fixture
async def app(tmp_path):
    async with station(tmp_path) as app:
        yield app


@pytest.fixture
async def admin(app):
    async with signed_in(app) as client:
        yield client


async def test_an_account_is_shown_without_its_password(admin):
    shown = (await admin.get("/api/gateways")).json()["gateways"]
    assert [one["kind"] for one in shown] == ["rockblock", "directip", "cloudloop"]
    assert shown[0] == shown[0] | {
        "title": "RockBLOCK",
        "url": "https://rockblock.example/MT",
        "username": "ann",
        "has_password": True,
        "has_public_key": True,
        "accepted": 0,
        "refused": {},
    }
    assert (shown[1]["has_password"], shown[1]["url"][:6]) == (False, "tcp://")


async def test_what_is_left_out_of_a_change_stays(app, admin):
    answer = await admin.put("/api/gateways/rockblock", json={"username": "bob"})
    assert answer.status_code == 200
    account = app.state.foundation.secrets.gateway("rockblock")
    assert (account.username, account.password) == ("bob", "s3cret-word")
    assert account.public_key == public_pem()


async def test_a_password_goes_to_no_other_address_unasked(app, admin):
    other = {"url": "https://evil.example/MT"}
    answer = await admin.put("/api/gateways/rockblock", json=other)
    assert (answer.status_code, answer.json()["errors"][0]["loc"]) == (422, ["password"])
    assert (await admin.put("/api/gateways/rockblock", json=other | {"password": "p"})).is_success
    assert app.state.foundation.secrets.gateway("rockblock").password == "p"


WRONG = [
    ("rockblock", {"url": "http://rockblock.example/MT"}),
    ("rockblock", {"url": "https://ann:word@rockblock.example/MT"}),
    ("rockblock", {"url": "https://rockblock.example/MT?password=x"}),
    ("rockblock", {"url": "ftp://rockblock.example"}),
    ("rockblock", {"url": "tcp://rockblock.example:1"}),
    ("rockblock", {"url": "https://[::1"}),
    ("rockblock", {"url": "https://gate\nway.example/"}),
    ("rockblock", {"public_key": "no key"}),
    ("rockblock", {"colour": "red"}),
    ("directip", {"url": "https://directip.example"}),
    ("directip", {"url": "tcp://directip.example"}),
    ("directip", {"url": "tcp://directip.example:99999"}),
    ("pigeon", {}),
]


async def test_what_is_wrong_is_refused_at_its_field_and_changes_nothing(app, admin):
    for kind, wrong in WRONG:
        answer = await admin.put(f"/api/gateways/{kind}", json=wrong | {"password": "pass-word-1"})
        assert answer.status_code == 422, wrong
        assert answer.json()["errors"]
        assert "pass-word-1" not in answer.text
    assert app.state.foundation.secrets.gateway("rockblock").password == "s3cret-word"


async def test_a_station_on_this_machine_may_speak_to_a_gateway_on_it_without_tls(admin):
    body = {"url": "http://127.0.0.1:8/MT", "password": "x"}
    assert (await admin.put("/api/gateways/rockblock", json=body)).is_success


async def test_a_damaged_account_is_told_and_can_be_entered_again(app, admin, tmp_path):
    (tmp_path / "secret" / "gateway-rockblock").write_text("{broken")
    shown = (await admin.get("/api/gateways")).json()["gateways"][0]
    assert "enter it again" in shown["fault"]
    with pytest.raises(GatewayRefusal) as found:
        await keeper_of(app).gateways.send("rockblock", IMEI, b"x", client_id=1)
    assert (found.value.fault, found.value.retry) == (GatewayFault.NO_ACCOUNT, "later")
    body = {"username": "ann", "password": "p"}
    assert (await admin.put("/api/gateways/rockblock", json=body)).json()["fault"] is None


# Sending through accounts.


async def send(app, carrier, imei=IMEI, data=b"x"):
    return await keeper_of(app).gateways.send(carrier, imei, data, client_id=7)


async def test_a_message_goes_by_the_account_that_holds_now(app):
    secrets = app.state.foundation.secrets
    async with http_peer([(200, "OK,1"), (200, "OK,2")]) as old, http_peer([(200, "OK,3")]) as new:
        account = GatewayAccount(url=f"{old.url}/MT", username="ann", password="p")
        secrets.set_gateway("rockblock", account)
        taken = [await send(app, "rockblock"), await send(app, "rockblock")]
        secrets.set_gateway("rockblock", account.model_copy(update={"url": f"{new.url}/MT"}))
        taken.append(await send(app, "rockblock"))
    assert [one.message_id for one in taken] == ["1", "2", "3"]


async def test_cloudloop_is_told_the_thing_that_the_robots_link_names(app):
    link = f"cloudloop://Thing0?imei={IMEI}"
    await app.state.foundation.store.write(
        lambda session: add_robot(session, robot(links=("xbee:///dev/ttyUSB0", link)))
    )
    async with http_peer([(200, '{"id": "MT9"}')]) as peer:
        account = GatewayAccount(url=f"{peer.url}/Data/DoSendSbdMessage", password="token")
        app.state.foundation.secrets.set_gateway("cloudloop", account)
        assert await send(app, "cloudloop") == Taken("MT9", None, None)
        assert b"thing=Thing0" in peer.requests[0].body
        with pytest.raises(GatewayRefusal, match="thing"):
            await send(app, "cloudloop", "300234010753371")


async def test_directip_connects_to_the_accounts_address(app):
    async with gateway_saying(lambda m: confirmation(m, 2)) as (gateway, _):
        account = GatewayAccount(url=f"tcp://127.0.0.1:{gateway._port}")
        app.state.foundation.secrets.set_gateway("directip", account)
        assert await send(app, "directip") == Taken("99", 7, 2)


async def test_without_an_account_nothing_is_sent_and_the_operator_is_told_what_to_do(app):
    for kind in ("directip", "cloudloop"):
        with pytest.raises(GatewayRefusal, match="enter it") as found:
            await send(app, kind)
        assert (found.value.fault, found.value.retry) == (GatewayFault.NO_ACCOUNT, "later")
    with pytest.raises(ValueError, match="no satellite gateway"):
        await send(app, "pigeon")


# The secret folder.


def test_secrets_are_for_the_stations_user_alone(tmp_path):
    store = SecretStore(tmp_path / "data" / "secret")
    store.robot_key("grace-1")
    store.push_path("rockblock")
    store.set_gateway("rockblock", GatewayAccount(url="https://a.example/MT"))
    folder = tmp_path / "data" / "secret"
    files = sorted(folder.iterdir())
    assert len(files) == 3
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(file.stat().st_mode) for file in files} == {0o600}


async def test_a_robots_key_is_made_once_even_by_many_at_the_same_time(tmp_path):
    stores = [SecretStore(tmp_path / "secret") for _ in range(8)]
    keys = await asyncio.gather(
        *(asyncio.to_thread(store.robot_key, "grace-1") for store in stores)
    )
    assert len(set(keys)) == 1
    assert len(keys[0]) == 32
    assert SecretStore(tmp_path / "secret").robot_key("mini-1") != keys[0]


def test_what_is_kept_is_read_back(tmp_path):
    store = SecretStore(tmp_path)
    assert (store.signing_key("grace-1"), store.gateway("rockblock")) == (None, None)
    (tmp_path / "signing-grace-1").write_text(bytes(range(32)).hex())
    account = GatewayAccount(url="https://a.example/MT", username="é", password="p\n\"'")
    store.set_gateway("rockblock", account)
    again = SecretStore(tmp_path)
    assert again.signing_key("grace-1") == bytes(range(32))
    assert again.gateway("rockblock") == account
    assert again.push_path("rockblock") == store.push_path("rockblock")
    assert again.push_path("rockblock") != again.push_path("cloudloop")
    (tmp_path / "signing-grace-1").unlink()
    assert again.signing_key("grace-1") is None


def test_a_damaged_secret_is_named_and_never_replaced(tmp_path):
    store = SecretStore(tmp_path)
    (tmp_path / "robot-grace-1").write_text("1234")
    (tmp_path / "robot-mini-1").write_bytes(b"\xff\xfe")
    for robot_id in ("grace-1", "mini-1"):
        with pytest.raises(SecretUnreadableError, match=f"robot-{robot_id}"):
            store.robot_key(robot_id)
    assert (tmp_path / "robot-grace-1").read_text() == "1234"


@pytest.mark.parametrize("content", [b"", b"no key", b"\xff\xfe"])
def test_a_damaged_key_of_browsers_makes_way_for_a_new_one(tmp_path, caplog, content):
    (tmp_path / "browser-marks").write_bytes(content)
    key = SecretStore(tmp_path).browser_key()
    assert len(key) == 32
    assert SecretStore(tmp_path).browser_key() == key
    assert "browser-marks" in caplog.text
    assert key.hex() not in caplog.text


@pytest.mark.parametrize("name", ["../x", "", "A", "a/b", "a" * 41])
def test_a_name_that_would_leave_the_folder_is_refused(tmp_path, name):
    with pytest.raises(ValueError, match="name"):
        SecretStore(tmp_path).robot_key(name)


def test_an_account_does_not_show_its_password_in_its_own_words():
    account = GatewayAccount(url="https://a.example/MT", password="s3cret-word")
    assert "s3cret" not in repr(account)
    assert "s3cret" not in str(account)


def test_a_signing_key_has_32_bytes(tmp_path):
    (tmp_path / "signing-grace-1").write_text(b"short".hex())
    with pytest.raises(SecretUnreadableError, match="signing-grace-1"):
        SecretStore(tmp_path).signing_key("grace-1")


def test_a_rate_limit_admits_a_burst_and_then_as_time_goes(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("server.access.rate.monotonic_s", lambda: now[0])
    limit = RateLimit(3, 2.0)
    assert [limit.admits() for _ in range(4)] == [True, True, True, False]
    now[0] = 1.0
    assert [limit.admits() for _ in range(3)] == [True, True, False]
    now[0] = 1000.0
    assert [limit.admits() for _ in range(4)] == [True, True, True, False]
