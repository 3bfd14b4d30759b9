"""Rights on chosen robots, groups, sessions and read-only links, as administrators give them."""

from datetime import timedelta

import httpx
import pytest
from sqlalchemy import update

from db.person_tables import Token
from db.query.station.events import newest_events
from server.access.access import Access
from server.access.caller import Proof
from server.access.role import Role
from server.access.secret import secret_hash
from server.base.live_feed import Audience, LiveFeed
from tests.server.conftest import GRACE, MINI, StationClient
from tests.server.station_app import PASSWORD, client_of
from tests.server.station_parts import OpenStation


async def person(client: StationClient, name: str, role: str, **more: object) -> httpx.AsyncClient:
    """Add a person and sign them in as a browser does."""
    body = {"name": name, "role": role, "password": PASSWORD, **more}
    added = await client.post("/api/people", json=body)
    assert added.status_code == 201, added.text
    return await browser_of(client, name)


async def browser_of(client: StationClient, name: str) -> httpx.AsyncClient:
    browser = client_of(client.app)
    session = await browser.post("/api/session", json={"name": name, "password": PASSWORD})
    assert session.status_code == 200, session.text
    browser.headers["X-CSRF-Token"] = session.json()["csrf_token"]
    return browser


async def fleet_of(browser: httpx.AsyncClient) -> set[str]:
    return {robot["id"] for robot in (await browser.get("/api/robots")).json()}


async def test_group_gives_a_right_on_whoever_is_in_it_now(client: StationClient):
    await client.put("/api/groups/lake", json={"robots": [MINI]})
    ben = await person(client, "ben", "none", grants=[{"group": "lake", "role": "pilot"}])
    assert await fleet_of(ben) == {MINI}
    await client.put("/api/groups/tank", json={"robots": [GRACE]})
    told = (await ben.get("/api/groups")).json()["groups"]
    assert told == [{"name": "lake", "robots": [MINI]}], "nobody hears of robots of others"
    await client.delete("/api/groups/tank")
    session = (await ben.get("/api/session")).json()
    assert (session["role"], session["robots"]) == ("none", {MINI: "pilot"})
    await client.put("/api/groups/lake", json={"robots": [GRACE], "seen": [MINI]})
    assert await fleet_of(ben) == {GRACE}
    assert (await client.delete("/api/groups/lake")).status_code == 409
    await client.patch("/api/people/ben", json={"grants": []})
    assert (await ben.get("/api/robots")).status_code == 403
    assert (await client.delete("/api/groups/lake")).status_code == 204


async def test_second_of_two_changes_at_once_is_refused(client: StationClient):
    await client.put("/api/groups/lake", json={"robots": [MINI], "seen": []})
    late = await client.put("/api/groups/lake", json={"robots": [GRACE], "seen": []})
    assert late.status_code == 409
    await person(client, "ben", "viewer")
    change = {"grants": [{"robot": MINI, "role": "pilot"}], "seen_grants": []}
    assert (await client.patch("/api/people/ben", json=change)).status_code == 200
    assert (await client.patch("/api/people/ben", json=change)).status_code == 409
    assert (await client.patch("/api/people/ben", json={"grants": [{"robot": "robot-9",
        "role": "pilot"}]})).status_code == 404  # fmt: skip
    kept = (await client.get("/api/people")).json()["people"][-1]["grants"]
    assert kept == [{"role": "pilot", "robot": MINI, "group": None}]


async def test_who_lowers_their_own_rights_is_asked_first(client: StationClient):
    ann = await person(client, "ann", "admin")
    lower = {"role": "pilot"}
    refused = await ann.patch("/api/people/ann", json=lower)
    assert refused.status_code == 409
    assert "confirm" in refused.json()["detail"]
    assert (await ann.patch("/api/people/ann", json={**lower, "confirm": True})).status_code == 409
    await person(client, "ben", "admin")
    assert (await ann.patch("/api/people/ann", json={**lower, "confirm": True})).status_code == 200
    assert (await ann.get("/api/people")).status_code == 401


async def test_changed_right_is_seen_by_what_looks_after_streams(
    client: StationClient, station: OpenStation
):
    access = station.foundation.services.get(Access)
    ben = await person(client, "ben", "none", grants=[{"robot": MINI, "role": "viewer"}])
    proofs = [Proof("session", secret_hash(value)) for value in dict(ben.cookies).values()]
    before = await access.rights_of(proofs)
    await client.patch("/api/people/ben", json={"grants": [{"robot": GRACE, "role": "viewer"}]})
    after = await access.rights_of(proofs)
    assert before.keys() == after.keys() != set()
    assert before != after


async def test_who_pilots_one_robot_says_how_they_are_told_and_no_other_person(
    client: StationClient,
):
    granted = {"robot": MINI, "role": "pilot"}
    ben = await person(client, "ben", "none", grants=[granted])
    await person(client, "ann", "pilot")
    eye = await person(client, "eye", "none", grants=[{**granted, "role": "viewer"}])
    hook = {"title": "phone", "form": "webhook", "address": "https://hooks.example.org/1"}
    for path in ("", "/station", "/people/ben"):
        assert (await ben.get(f"/api/notices{path}")).status_code == 200, path
        assert (await eye.get(f"/api/notices{path}")).status_code == 403, path
    assert (await ben.put("/api/notices/people/ben", json={})).status_code == 200
    made = await ben.post("/api/notices/people/ben/contacts", json=hook)
    assert made.status_code == 201, made.text
    contact = f"/api/notices/contacts/{made.json()['id']}"
    assert (await eye.delete(contact)).status_code == 403
    assert (await ben.patch(contact, json={"enabled": False})).status_code == 200
    assert (await ben.delete(contact)).status_code == 204
    for who in ("ann", "eye"):
        assert (await ben.get(f"/api/notices/people/{who}")).status_code == 403
        foreign = await ben.post(f"/api/notices/people/{who}/contacts", json=hook)
        assert foreign.status_code == 403
    for path in ("station", "heartbeat"):
        assert (await ben.put(f"/api/notices/{path}", json={})).status_code == 403


async def test_every_change_of_rights_is_in_the_log(client: StationClient, station: OpenStation):
    await client.put("/api/groups/lake", json={"robots": [MINI]})
    await person(client, "ben", "none", grants=[{"group": "lake", "role": "pilot"}])
    await client.patch("/api/people/ben", json={"grants": [{"robot": MINI, "role": "viewer"}]})
    await client.post("/api/read-only-links", json={"name": "pier", "robots": [MINI]})
    events = await station.foundation.store.query(newest_events)
    texts = " ".join(event.text for event in events)
    assert "pilot of the group lake" in texts
    assert f"who is now viewer of {MINI}" in texts
    assert f"(pier), which shows {MINI}" in texts


async def link_to(client: StationClient, *robots: str) -> tuple[str, str]:
    made = await client.post("/api/read-only-links", json={"name": "pier", "robots": robots})
    assert made.status_code == 201, made.text
    return made.json()["id"], made.json()["address"].removeprefix("/#look=")


async def looking(client: StationClient, secret: str) -> httpx.AsyncClient:
    browser = client_of(client.app)
    opened = await browser.post("/api/session", json={"link": secret})
    assert opened.status_code == 200, opened.text
    browser.headers["X-CSRF-Token"] = opened.json()["csrf_token"]
    return browser


async def test_read_only_link_shows_chosen_robots_and_no_secrets(
    client: StationClient, station: OpenStation
):
    await station.foundation.alarms.raise_("test", "It leaks.", robot=MINI)
    alarm = station.foundation.alarms.open[0].id
    await client.post(f"/api/alarms/{alarm}/ack", json={"note": "ben looks after it"})
    _, secret = await link_to(client, MINI)
    browser = await looking(client, secret)
    session = (await browser.get("/api/session")).json()
    assert (session["is_link"], session["rights"], session["robots"]) == (
        True,
        [],
        {MINI: "viewer"},
    )
    assert await fleet_of(browser) == {MINI}
    state = (await browser.get(f"/api/robots/{MINI}/state")).json()
    assert state["links"] == []
    assert state["position"] is not None
    alarms = (await browser.get("/api/alarms")).text
    assert "It leaks." in alarms
    assert "ben looks" not in alarms
    assert "test admin" not in alarms
    for path in (
        f"/api/robots/{GRACE}", "/api/events", "/api/people", "/api/jobs", "/api/sessions",
        f"/api/robots/{MINI}/links", f"/api/robots/{MINI}/commands", "/api/signing",
        "/api/journal?robot=mini-1", "/api/logbook",
    ):  # fmt: skip
        assert (await browser.get(path)).status_code in {403, 404}, path
    for path in (f"/api/robots/{MINI}/commands", "/api/session/ticket", "/api/deployments"):
        assert (await browser.post(path, json={"kind": "surface"})).status_code == 403, path


async def test_link_shows_the_water_of_its_robots_and_no_other(
    client: StationClient, station: OpenStation
):
    document = station.fleet.status(MINI).record.site.model_dump(mode="json")
    other = {"document": {**document, "name": "Elsewhere"}}
    assert (await client.post("/api/waters", json=other)).status_code == 201
    waters = (await client.get("/api/waters")).json()
    assert len(waters) > 1
    (of_robot,) = [water["id"] for water in waters if MINI in water["robots"]]
    _, secret = await link_to(client, MINI)
    browser = await looking(client, secret)
    for water in (each["id"] for each in waters):
        for part in ("", "/outline", "/depths"):
            path = f"/api/waters/{water}{part}"
            whole, shown = (await client.get(path)).status_code, await browser.get(path)
            assert shown.status_code == (whole if water == of_robot else 404), path
    assert (await browser.get(f"/api/waters/{of_robot}")).json()["robots"] == [MINI]


@pytest.mark.parametrize("end", ["revoked", "expired"])
async def test_link_that_has_ended_ends_who_looks_by_it(
    client: StationClient, station: OpenStation, end: str
):
    link, secret = await link_to(client, MINI)
    browser = await looking(client, secret)
    if end == "revoked":
        assert (await client.delete(f"/api/read-only-links/{link}")).status_code == 204
    else:
        past = station.foundation.clock.now() - timedelta(hours=1)
        await station.foundation.store.write(
            lambda session: session.execute(
                update(Token).where(Token.is_link).values(expires_at=past)
            )
        )
    assert (await browser.get("/api/robots")).status_code == 401
    async with client_of(client.app) as late:
        assert (await late.post("/api/session", json={"link": secret})).status_code == 401
        bearing = {"Authorization": f"Bearer {secret}"}
        assert (await late.get("/api/robots", headers=bearing)).status_code == 401


async def test_live_stream_of_a_link_tells_of_its_robots_and_of_no_event(station: OpenStation):
    feed, told = station.foundation.services.get(LiveFeed), []

    class EnoughError(Exception):
        pass

    async def keep(batch: str) -> None:
        told.append(batch)
        raise EnoughError

    with pytest.raises(EnoughError):
        await feed.follow(keep, None, 0, Audience(frozenset({MINI}), is_public=True))
    assert MINI in told[0]
    assert GRACE not in told[0]
    assert "xbee://" not in told[0]
    assert '"events":[]' in told[0]


async def test_sessions_are_listed_and_ended(client: StationClient):
    await person(client, "ben", "viewer")
    first, second = await browser_of(client, "ben"), await browser_of(client, "ben")
    second.headers["User-Agent"] = "Mozilla/5.0 (X11; Linux x86_64) Gecko/20100101 Firefox/140.0"
    shown = (await first.get("/api/sessions?everybody=true")).json()["sessions"]
    assert {one["name"] for one in shown} == {"ben"}
    assert [one["is_own"] for one in shown].count(True) == 1
    newest = shown[0]["id"]
    assert (await first.delete(f"/api/sessions/{newest}")).status_code == 204
    assert (await second.get("/api/session")).status_code == 401
    ann = await person(client, "ann", "admin")
    anns = (await ann.get("/api/sessions")).json()["sessions"][0]["id"]
    assert (await first.delete(f"/api/sessions/{anns}")).status_code == 404
    third = await browser_of(client, "ben")
    assert (await third.delete("/api/sessions")).status_code == 204
    assert (await first.get("/api/session")).status_code == 401
    assert (await third.get("/api/session")).status_code == 200


async def test_token_of_a_persons_name_does_not_reach_their_sessions(client: StationClient):
    await person(client, "ben", "viewer")
    made = await client.post("/api/tokens", json={"name": "ben", "role": Role.VIEWER})
    async with client_of(
        client.app, headers={"Authorization": f"Bearer {made.json()['token']}"}
    ) as script:
        assert (await script.get("/api/sessions")).status_code == 403
        assert (await script.delete("/api/sessions")).status_code == 403
