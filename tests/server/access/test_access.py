"""Who gets in, and what they may do."""

import asyncio
import json
import re
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest
from fastapi import WebSocketException
from starlette.websockets import WebSocket

from db.query.station.people import TokenRecord
from robot_link.clock import monotonic_s
from server.access import (
    access,
    people_route,
    register,
    session_route,
    sign_in_route,
    stream,
)
from server.access.caller import Caller, Proof
from server.access.guard import Guard
from server.access.role import Rights, Role
from server.base.settings import Settings
from tests.server.conftest import application
from tests.server.station_app import (
    BASE_URL,
    PASSWORD,
    admin_of,
    bearer,
    client_of,
    running,
    token_of,
)

OPEN_TO_ALL = {
    ("GET", "/api/health"),
    ("GET", "/api/session/provider"),
    ("POST", "/api/session"),
    ("POST", "/api/session/first"),
    ("POST", "/api/gateways/rockblock/push/{secret}"),
    ("POST", "/api/gateways/cloudloop/push/{secret}"),
}
"""Which provider of OpenID Connect there is must be known to sign in by it. Pushes of gateways
prove themselves otherwise: by their path and what they say."""
OPEN_TO_VIEWERS = {
    "/api/robots/{robot}/view/replay/{tab}",
    "/api/session",
    "/api/session/ticket",
    "/api/robots/{robot}/parameters/compare",
    "/api/robots/{robot}/designs/check",
    "/api/designs/{design}/difference",
}
"""Signing out, looking on, and comparing: none changes what anybody else sees.

Comparisons and checks are a POST because a file or a document travels in the body; they write
nothing.
"""
ADMIN_ONLY = {
    "/api/people",
    "/api/people/{name}",
    "/api/tokens",
    "/api/tokens/{token}",
    "/api/gateways",
    "/api/gateways/{kind}",
}


def operations():
    """Every operation of the REST interface: method, path as declared, path to ask.

    The live stream stands in the document too, but is a WebSocket, which refuses by itself.
    """
    for path, item in application().openapi()["paths"].items():
        for method, operation in item.items():
            is_stream = "101" in operation["responses"]
            if not is_stream and (method.upper(), path) not in OPEN_TO_ALL:
                yield method.upper(), path, re.sub(r"{\w+}", "x-1", path)


async def test_nothing_but_health_is_told_to_strangers(app, anyone):
    asked = 0
    for method, _, path in operations():
        answer = await anyone.request(method, path, json={})
        assert answer.status_code == 401, (method, path)
        assert answer.headers["WWW-Authenticate"] == "Bearer"
        asked += 1
    assert asked > 20


async def test_a_viewer_changes_nothing(app, anyone):
    headers = bearer(await token_of(app, Role.VIEWER))
    for method, declared, path in operations():
        if method != "GET" and declared not in OPEN_TO_VIEWERS:
            answer = await anyone.request(method, path, json={}, headers=headers)
            assert answer.status_code == 403, (method, path)
    for path in ("/api/session", "/api/config", "/api/events", "/api/alarms", "/api/jobs"):
        assert (await anyone.get(path, headers=headers)).status_code == 200


async def test_people_and_tokens_are_for_administrators(app, anyone):
    headers = bearer(await token_of(app, Role.PILOT))
    for method, declared, path in operations():
        if declared in ADMIN_ONLY:
            answer = await anyone.request(method, path, json={}, headers=headers)
            assert answer.status_code == 403, (method, path)


async def test_a_pilot_configures(app, anyone):
    headers = bearer(await token_of(app, Role.PILOT))
    changed = await anyone.patch("/api/config/planner", json={"seed": 4}, headers=headers)
    assert changed.status_code == 200
    assert changed.json()["changed_by"] == "script"


async def test_health_needs_no_sign_in_and_says_that_nobody_can(anyone):
    answer = (await anyone.get("/api/health")).json()
    assert (answer["status"], answer["ready"], answer["first_start"]) == ("ok", True, True)


async def test_the_first_administrator_needs_the_code_that_was_printed(app, anyone):
    body = {"name": "eve", "password": PASSWORD, "code": "AAAAA-AAAAA"}
    refused = await anyone.post("/api/session/first", json=body)
    assert refused.status_code == 403
    body["code"] = app.state.first_code.lower()
    assert (await anyone.post("/api/session/first", json=body)).status_code == 201
    again = await anyone.post("/api/session/first", json=body)
    assert again.status_code == 409
    assert (await anyone.get("/api/health")).json()["first_start"] is False


async def test_a_short_password_is_refused_at_its_field(app, anyone):
    body = {"name": "eve", "password": "short", "code": app.state.first_code}
    answer = await anyone.post("/api/session/first", json=body)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["loc"] == ["password"]


async def test_name_and_password_open_a_session_and_signing_out_ends_it(admin, anyone):
    assert (await anyone.post("/api/session", json={"name": "ann"})).status_code == 422
    wrong = {"name": "ann", "password": "not the password"}
    assert (await anyone.post("/api/session", json=wrong)).status_code == 401
    right = {"name": "ann", "password": PASSWORD}
    session = (await anyone.post("/api/session", json=right)).json()
    assert (session["role"], session["rights"]) == ("admin", ["view", "pilot", "administer"])
    cookie = dict(anyone.cookies)
    anyone.headers["X-CSRF-Token"] = session["csrf_token"]
    assert (await anyone.delete("/api/session")).status_code == 204
    anyone.cookies.update(cookie)
    assert (await anyone.get("/api/session")).status_code == 401


def test_who_holds_a_secret_does_not_show_it_in_its_own_words():
    at, word = datetime.now(UTC), "s3cret-word"
    proof = Proof("token", "digest")
    somebody = Caller("ann", Rights(Role.ADMIN), at, word, proof)
    token = TokenRecord("1", "ann", Role.ADMIN, False, False, at, at, None, None)
    holders = [
        somebody,
        access.SignedIn(word, somebody),
        register.IssuedToken(word, token),
        sign_in_route.NewLinkView("1", word, at),
        people_route.NewTokenView("1", word, at),
        session_route.SessionView("ann", Role.ADMIN, [], {}, False, word, at),
        session_route.TicketView(word, 60.0),
    ]
    assert not [one for one in holders if word in repr(one)]


@pytest.mark.parametrize(
    "change", [{"password": f"{PASSWORD} anew"}, {"disabled": True}], ids=["password", "disabled"]
)
async def test_who_is_changed_while_their_password_is_judged_is_not_let_in(
    app, admin, anyone, monkeypatch, change
):
    person = {"name": "bob", "role": "pilot", "password": PASSWORD}
    assert (await admin.post("/api/people", json=person)).status_code == 201
    door = app.state.foundation.services.get(access.Access)
    judge = door._gate.run

    async def run(work):
        fits = await judge(work)
        assert (await admin.patch("/api/people/bob", json=change)).status_code == 200
        return fits

    monkeypatch.setattr(door._gate, "run", run)
    answer = await anyone.post("/api/session", json={"name": "bob", "password": PASSWORD})
    assert answer.status_code == 401
    assert "set-cookie" not in answer.headers


async def test_what_has_expired_stays_so_when_the_clock_is_set_back(app, admin, monkeypatch):
    door = app.state.foundation.services.get(access.Access)
    token = await token_of(app, Role.VIEWER)
    later = datetime.now(UTC) + timedelta(days=30)
    monkeypatch.setattr(type(door._wall), "now", lambda _: later)
    assert (await admin.get("/api/session")).status_code == 401
    monkeypatch.undo()
    assert (await admin.get("/api/session")).status_code == 401
    async with client_of(app, headers=bearer(token)) as script:
        assert (await script.get("/api/session")).status_code == 401


@pytest.mark.parametrize("text", ["\u00e9", "\ud800"])
async def test_characters_of_any_kind_are_wrong_and_no_failure(app, anyone, text):
    body = json.dumps({"name": "eve", "password": PASSWORD, "code": text})
    headers = {"Content-Type": "application/json"}
    answer = await anyone.post("/api/session/first", content=body, headers=headers)
    assert answer.status_code in {403, 422}
    for fields in ({"name": "ann", "password": text}, {"token": text}, {"name": text}):
        answer = await anyone.post("/api/session", content=json.dumps(fields), headers=headers)
        assert answer.status_code in {401, 422}


async def test_the_cookie_is_out_of_reach_of_scripts_and_named_by_port(app, anyone):
    body = {"name": "ann", "password": PASSWORD, "code": app.state.first_code}
    cookie = (await anyone.post("/api/session/first", json=body)).headers["set-cookie"]
    assert cookie.startswith("grace_session_8000=")
    assert "HttpOnly" in cookie
    assert "samesite=lax" in cookie.lower()
    assert "secure" not in cookie.lower()


async def test_a_change_by_cookie_needs_the_csrf_token(admin):
    del admin.headers["X-CSRF-Token"]
    answer = await admin.patch("/api/config/planner", json={"seed": 4})
    assert answer.status_code == 403
    assert "X-CSRF-Token" in answer.json()["detail"]
    assert (await admin.get("/api/config/planner")).json()["id"] is None


async def test_a_change_by_cookie_from_a_foreign_page_is_refused(admin):
    for origin, status in (("http://evil.example", 403), ("null", 403), (BASE_URL, 200)):
        answer = await admin.patch(
            "/api/config/planner", json={"seed": 4}, headers={"Origin": origin}
        )
        assert answer.status_code == status


async def test_a_foreign_page_cannot_sign_a_browser_in(admin, anyone):
    body = {"name": "ann", "password": PASSWORD}
    headers = {"Origin": "http://evil.example"}
    assert (await anyone.post("/api/session", json=body, headers=headers)).status_code == 403


async def test_a_name_bent_to_loopback_is_not_this_station(anyone):
    answer = await anyone.get("/api/health", headers={"Host": "rebound.example:8000"})
    assert answer.status_code == 421
    assert answer.headers["content-type"] == "application/problem+json"


async def test_a_bearer_token_ends_with_its_time_or_its_revocation(app, admin, anyone):
    expired = bearer(await token_of(app, Role.PILOT, seconds=-1))
    assert (await anyone.get("/api/session", headers=expired)).status_code == 401
    made = (await admin.post("/api/tokens", json={"name": "survey", "role": "pilot"})).json()
    headers = bearer(made["token"])
    whoami = (await anyone.get("/api/session", headers=headers)).json()
    assert (whoami["name"], whoami["role"], whoami["csrf_token"]) == ("survey", "pilot", None)
    listed = (await admin.get("/api/tokens")).json()["tokens"]
    assert made["id"] in {token["id"] for token in listed}
    assert made["token"] not in str(listed)
    assert (await admin.delete(f"/api/tokens/{made['id']}")).status_code == 204
    answer = await anyone.get("/api/session", headers=headers)
    assert answer.status_code == 401
    assert "revoked" in answer.json()["detail"]


async def test_a_one_time_link_signs_in_once_and_leads_to_the_app(app, admin, anyone):
    foundation = app.state.foundation
    issued = await foundation.store.write(
        lambda s: register.create_sign_in_link(
            s, "ann", timedelta(minutes=1), at=foundation.clock.now(), by="test"
        )
    )
    answer = await anyone.get("/sign-in", params={"token": issued.secret})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    assert (await anyone.get("/api/session")).json()["name"] == "ann"
    anyone.cookies.clear()
    again = await anyone.get("/sign-in", params={"token": issued.secret})
    assert again.status_code == 303
    assert "set-cookie" not in again.headers
    assert (await anyone.get("/api/session")).status_code == 401


async def test_who_loses_a_role_loses_the_session_with_it(app, admin):
    person = {"name": "bob", "role": "pilot", "password": PASSWORD}
    assert (await admin.post("/api/people", json=person)).status_code == 201
    assert (await admin.post("/api/people", json=person)).status_code == 409
    async with client_of(app) as bob:
        sign_in = {"name": "bob", "password": PASSWORD}
        await bob.post("/api/session", json=sign_in)
        assert (await bob.get("/api/session")).json()["role"] == "pilot"
        await admin.patch("/api/people/bob", json={"role": "viewer"})
        assert (await bob.get("/api/session")).status_code == 401
        await admin.patch("/api/people/bob", json={"disabled": True})
        assert (await bob.post("/api/session", json=sign_in)).status_code == 401


async def test_the_last_administrator_stays(admin):
    for change in ({"role": "viewer", "confirm": True}, {"disabled": True, "confirm": True}):
        answer = await admin.patch("/api/people/ann", json=change)
        assert answer.status_code == 409
        assert "last administrator" in answer.json()["detail"]
    assert (await admin.get("/api/session")).status_code == 200


async def test_people_are_changed_where_scripts_alone_administer(app):
    async with client_of(app) as script:
        script.headers.update(bearer(await token_of(app, Role.ADMIN)))
        person = {"name": "bob", "role": "pilot", "password": PASSWORD}
        assert (await script.post("/api/people", json=person)).status_code == 201
        for change in ({"role": "viewer"}, {"disabled": True}, {"disabled": False}):
            answer = await script.patch("/api/people/bob", json=change)
            assert answer.status_code == 200, answer.text
        made = await script.patch("/api/people/bob", json={"role": "admin"})
        assert made.json()["role"] == "admin"
        refused = await script.patch("/api/people/bob", json={"role": "pilot"})
        assert refused.status_code == 409
        assert "last administrator" in refused.json()["detail"]


def websocket_of(app, headers, query=""):
    scope = {
        "type": "websocket",
        "scheme": "ws",
        "path": "/api/live",
        "query_string": query.encode(),
        "server": ("127.0.0.1", 8000),
        "headers": [(name.lower().encode(), value.encode()) for name, value in headers.items()],
        "app": app,
    }
    return WebSocket(scope, receive=SimpleNamespace, send=SimpleNamespace)


@pytest.mark.parametrize(
    ("origin", "host", "allowed"),
    [
        (BASE_URL, "127.0.0.1:8000", True),
        ("http://evil.example", "127.0.0.1:8000", False),
        (None, "127.0.0.1:8000", False),
        ("http://rebound.example", "rebound.example", False),
    ],
)
async def test_a_websocket_with_a_cookie_must_come_from_the_stations_page(
    app, admin, origin, host, allowed
):
    name = "grace_session_8000"
    headers = {"Host": host, "Cookie": f"{name}={admin.cookies[name]}"}
    if origin is not None:
        headers["Origin"] = origin
    guard = app.state.foundation.services.get(Guard)
    if allowed:
        assert (await guard.websocket_caller(websocket_of(app, headers))).name == "ann"
    else:
        with pytest.raises(WebSocketException):
            await guard.websocket_caller(websocket_of(app, headers))


async def test_a_script_opens_a_websocket_by_header_or_by_a_ticket_that_works_once(app, anyone):
    token = await token_of(app, Role.VIEWER)
    guard = app.state.foundation.services.get(Guard)
    host = {"Host": "127.0.0.1:8000"}
    by_header = websocket_of(app, {**host, **bearer(token)})
    assert (await guard.websocket_caller(by_header)).name == "script"
    issued = await anyone.post("/api/session/ticket", headers=bearer(token))
    assert issued.status_code == 201
    ticket = issued.json()["ticket"]
    by_ticket = websocket_of(app, host, f"ticket={ticket}")
    assert (await guard.websocket_caller(by_ticket)).name == "script"
    for query in (f"ticket={ticket}", f"token={token}", f"ticket={token}", "ticket=grace_wrong"):
        with pytest.raises(WebSocketException):
            await guard.websocket_caller(websocket_of(app, host, query))


async def test_a_ticket_ends_with_its_time_and_with_the_token_that_asked_for_it(
    app, admin, anyone, monkeypatch
):
    made = (await admin.post("/api/tokens", json={"name": "plot", "role": "viewer"})).json()
    guard = app.state.foundation.services.get(Guard)
    host = {"Host": "127.0.0.1:8000"}

    async def ticket():
        issued = await anyone.post("/api/session/ticket", headers=bearer(made["token"]))
        return websocket_of(app, host, f"ticket={issued.json()['ticket']}")

    late, revoked = await ticket(), await ticket()
    monkeypatch.setattr(stream, "monotonic_s", lambda: monotonic_s() + stream.TICKET_S)
    with pytest.raises(WebSocketException):
        await guard.websocket_caller(late)
    monkeypatch.undo()
    await admin.delete(f"/api/tokens/{made['id']}")
    with pytest.raises(WebSocketException):
        await guard.websocket_caller(revoked)


@pytest.mark.parametrize(
    ("settings", "fits"),
    [
        ({"host": "127.0.0.1"}, True),
        ({"host": "::1"}, True),
        ({"host": "localhost"}, True),
        ({"host": "0.0.0.0"}, False),
        ({"host": "192.168.1.5"}, False),
        ({"host": "station.example"}, False),
        ({"host": "0.0.0.0", "behind_proxy": True}, True),
        ({"host": "0.0.0.0", "tls_certificate": "c.pem", "tls_key": "k.pem"}, True),
        ({"host": "0.0.0.0", "tls_certificate": "c.pem"}, False),
    ],
)
def test_only_loopback_is_served_without_tls(settings, fits):
    if fits:
        assert Settings(**settings).host == settings["host"]
    else:
        with pytest.raises(ValueError, match=r"tls|TLS"):
            Settings(**settings)


async def test_two_stations_in_one_process_share_nothing(tmp_path):
    async with running(tmp_path / "a") as first, running(tmp_path / "b") as second:
        async with admin_of(first) as admin, client_of(second) as stranger:
            stranger.cookies.update(admin.cookies)
            assert (await admin.get("/api/session")).status_code == 200
            assert (await stranger.get("/api/session")).status_code == 401
            await asyncio.gather(
                admin.patch("/api/config/planner", json={"seed": 4}), stranger.get("/api/health")
            )
        async with admin_of(second) as other:
            assert (await other.get("/api/config/planner")).json()["id"] is None


async def test_a_token_in_the_address_lets_nobody_in(app):
    token = await token_of(app, Role.ADMIN)
    async with client_of(app) as client:
        assert (await client.get(f"/api/session?token={token}")).status_code == 401


def test_environment_variables_are_settings(monkeypatch):
    monkeypatch.setenv("GRACE_PORT", "9000")
    monkeypatch.setenv("GRACE_SESSION_HOURS", "1.5")
    settings = Settings()
    assert (settings.port, settings.session_hours) == (9000, 1.5)


@pytest.mark.parametrize("name", ["a\nb", "a\u202eb", "\x1b[2J", "a\u2028b", "  "])
async def test_a_name_holds_nothing_that_cannot_be_seen(admin, name):
    person = {"name": name, "role": "pilot", "password": PASSWORD}
    answer = await admin.post("/api/people", json=person)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["loc"] == ["name"]
    answer = await admin.post("/api/tokens", json={"name": name, "role": "viewer"})
    assert answer.status_code == 422


async def test_a_cursor_of_another_log_is_refused_with_a_word(admin):
    assert (await admin.get("/api/events", params={"after": 0})).status_code == 200
    answer = await admin.get("/api/events", params={"after": 2**40})
    assert answer.status_code == 409
    assert "the cursor 1099511627776 is of another one" in answer.json()["detail"]
    assert (await admin.get("/api/events", params={"after": 2**63})).status_code == 422


@pytest.mark.parametrize(
    ("settings", "origin", "fits"),
    [
        ({}, "http://127.0.0.1:8000", True),
        ({}, "https://127.0.0.1:8000", False),
        ({"behind_proxy": True}, "https://127.0.0.1:8000", True),
        ({"behind_proxy": True}, "http://127.0.0.1:8000", False),
        ({"public_origins": ("https://a.example",)}, "https://a.example", True),
        ({"public_origins": ("https://a.example",)}, "http://a.example", False),
    ],
)
async def test_a_page_is_the_stations_by_its_scheme_too(tmp_path, settings, origin, fits):
    async with running(tmp_path, **settings) as app, client_of(app) as client:
        body = {"name": "nobody", "password": PASSWORD}
        answer = await client.post("/api/session", json=body, headers={"Origin": origin})
        assert answer.status_code == (401 if fits else 403)


async def test_browsers_of_a_station_with_tls_come_by_tls_alone(tmp_path):
    async with running(tmp_path, behind_proxy=True) as app, client_of(app) as client:
        assert "max-age" in (await client.get("/api/health")).headers["Strict-Transport-Security"]


async def test_a_station_without_tls_does_not_demand_it(anyone):
    assert "Strict-Transport-Security" not in (await anyone.get("/api/health")).headers
