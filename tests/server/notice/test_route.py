"""Who may see and change how people are told, and that addresses are shown to nobody."""

from contextlib import asynccontextmanager

import httpx
import pytest

from server.access.role import Role
from tests.server.conftest import application
from tests.server.notice.conftest import ORIGIN, NoticeStation
from tests.server.notice.receiver import web_service
from tests.server.station_app import bearer, token_of

HOOK = "https://hooks.example.org/T0/secret-word?key=hidden"


@asynccontextmanager
async def script(role: Role, name: str):
    """A script with a token, which may be named like a person."""
    transport = httpx.ASGITransport(application())
    headers = bearer(await token_of(application(), role, name))
    async with httpx.AsyncClient(transport=transport, base_url=ORIGIN, headers=headers) as client:
        yield client


async def test_an_address_is_never_shown_again(here: NoticeStation):
    contact = await here.contact("ann", HOOK)
    answers = [
        await here.client.get("/api/notices/people/ann"),
        await here.client.patch(f"/api/notices/contacts/{contact}", json={"title": "pager"}),
        await here.client.get("/api/notices"),
        await here.client.get("/api/notices/station"),
        await here.client.get("/api/events?limit=500"),
    ]
    for answer in answers:
        assert answer.is_success, answer.text
        assert "secret-word" not in answer.text
        assert "hidden" not in answer.text
    (shown,) = answers[0].json()["contacts"]
    assert (shown["hint"], shown["form"]) == ("webhook at hooks.example.org", "webhook")


async def test_a_refused_address_is_not_repeated(here: NoticeStation):
    body = {"title": "x", "form": "webhook", "address": "nohttp://secret-word"}
    answer = await here.client.post("/api/notices/people/ann/contacts", json=body)
    assert answer.status_code == 422
    assert "secret-word" not in answer.text


async def test_a_script_named_like_a_person_does_not_get_that_persons_contacts(
    here: NoticeStation,
):
    contact = await here.contact("ann", HOOK)
    async with script(Role.PILOT, "ann") as client:
        for method, path, body in (
            ("GET", "/api/notices/people/ann", None),
            ("PUT", "/api/notices/people/ann", {}),
            ("POST", "/api/notices/people/ann/contacts", {"title": "x", "form": "mail",
                                                          "address": "eve@example.org"}),
            ("PATCH", f"/api/notices/contacts/{contact}", {"enabled": False}),
            ("DELETE", f"/api/notices/contacts/{contact}", None),
            ("POST", f"/api/notices/contacts/{contact}/test", None),
        ):  # fmt: skip
            answer = await client.request(method, path, json=body)
            assert answer.status_code == 403, (method, path, answer.text)
        assert (await client.get("/api/notices")).json()["notices"] == []


@pytest.mark.parametrize("path", ["station", "mail-server", "heartbeat"])
async def test_what_holds_for_everybody_is_an_admins_to_change(here: NoticeStation, path: str):
    async with script(Role.PILOT, "bot") as client:
        bodies = {
            "station": {},
            "mail-server": {"host": "mail.test", "sender": "a@b.org"},
            "heartbeat": {"url": None},
        }
        answer = await client.put(f"/api/notices/{path}", json=bodies[path])
        assert answer.status_code == 403
    async with script(Role.VIEWER, "eye") as client:
        assert (await client.get("/api/notices/station")).status_code == 403


async def test_a_test_tells_the_services_own_words_and_how_long_it_took(here: NoticeStation):
    async with web_service("refuse") as service:
        contact = await here.contact("ann", service.url)
        told = (await here.client.post(f"/api/notices/contacts/{contact}/test")).json()
    assert (told["is_handed"], told["reply"]) == (False, "HTTP 403 Forbidden: thank you")
    assert told["took_s"] > 0.0
    assert told["notice"]["state"] == "given_up"


async def test_a_removed_contact_leaves_no_address_behind(here: NoticeStation):
    contact = await here.contact("ann", HOOK)
    file = here.foundation.settings.secret_dir / f"notice-{contact}"
    assert file.stat().st_mode & 0o077 == 0
    assert (await here.client.delete(f"/api/notices/contacts/{contact}")).status_code == 204
    assert not file.exists()
    again = await here.client.post(f"/api/notices/contacts/{contact}/test")
    assert again.status_code == 404


async def test_a_password_does_not_follow_to_another_mail_server(here: NoticeStation):
    body = {"host": "mail.test", "sender": "a@b.org", "username": "a", "password": "hidden"}
    first = await here.client.put("/api/notices/mail-server", json=body)
    assert first.json()["mail_server"]["has_password"]
    assert "hidden" not in first.text
    moved = {"host": "evil.test", "sender": "a@b.org", "username": "a"}
    refused = await here.client.put("/api/notices/mail-server", json=moved)
    assert (refused.status_code, refused.json()["errors"][0]["loc"]) == (422, ["password"])
    kept = await here.client.put("/api/notices/mail-server", json=moved | {"host": "mail.test"})
    assert kept.json()["mail_server"]["has_password"]


async def test_an_escalation_names_people_that_there_are(here: NoticeStation):
    steps = [{"people": ["nobody"], "after_minutes": 10}]
    refused = await here.client.put("/api/notices/station", json={"steps": steps})
    assert refused.status_code == 422
    steps = [{"people": ["ben"], "after_minutes": 10}]
    shown = (await here.client.put("/api/notices/station", json={"steps": steps})).json()
    assert shown["unreachable"] == ["ben"]
