"""Nothing may that may not: every robot route, by right on the robot and by who is in charge of it.

What is expected is worked out here from ranks and from one table of holders, and which routes send
robots something from the list of ``test_pilot_routes``; not from the code that decides.
"""

from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import product

import httpx
import pytest
from sqlalchemy.orm import Session
from starlette.requests import Request

from db.query.fleet.leases import LeaseRecord, get_lease, put_lease
from db.query.station import grants
from db.query.station.grants import GrantRecord
from db.query.station.people import add_person, add_session
from db.writer import tell_after_commit
from server.access import presence
from server.access.caller import Caller
from server.access.guard import Guard
from server.access.register import create_token
from server.access.role import Right, Role
from server.access.secret import new_secret, secret_hash
from server.access.subject import Subjects
from server.base.problem import Problem
from server.lease import ground_station
from server.lease.leases import Leases
from server.lease.state import LeaseChanged
from tests.server.access.rows import ids_of
from tests.server.access.test_pilot_routes import SENDS
from tests.server.access.test_rights import CALLERS, RANK, THROUGH, Case, cases
from tests.server.conftest import GRACE, MINI, StationClient, until
from tests.server.station_app import BASE_URL, bearer, client_of
from tests.server.station_parts import OpenStation

KINDS = ("person", "script")
HOLDERS = {
    "nobody": {"person", "script"},
    "the caller": {"person", "script"},
    "another person": set[str](),
    "another person, who lets the caller act": {"script"},
    "another script": {"person"},
    "another ground station": set[str](),
}
"""Who is in charge, and whom that lets send something."""
IN_FULL = ((Role.PILOT, Role.NONE), (Role.NONE, Role.PILOT))
"""Callers for whom the routes that send nothing are asked too, for every holder."""


@dataclass(frozen=True)
class Someone:
    """A caller of the station."""

    kind: str
    role: Role
    granted: Role
    """On ``MINI``."""
    name: str
    token: str | None
    headers: dict[str, str]


@dataclass(frozen=True)
class World:
    """A station, whose leases are what a test says."""

    station: OpenStation
    anyone: httpx.AsyncClient

    @property
    def leases(self) -> Leases:
        return self.station.foundation.services.get(Leases)

    async def put(self, robot: str, record: LeaseRecord) -> None:
        """Have a lease be something, whatever was before."""

        def write(session: Session) -> None:
            before = get_lease(session, robot)
            put_lease(session, record)
            tell_after_commit(session, LeaseChanged(record, before), robot)

        await self.station.foundation.store.write(write)
        await until(lambda: self.leases.of(robot) == record)

    async def ask(
        self, who: Someone, method: str, path: str, body: object = None
    ) -> httpx.Response:
        return await self.anyone.request(method, path, headers=who.headers, json=body)


@pytest.fixture
async def here(
    station: OpenStation, client: StationClient, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[World]:
    # Another ground station keeps its robots, and nobody falls silent, on a machine of any speed.
    monkeypatch.setattr(ground_station, "QUIET_S", 1e6)
    monkeypatch.setattr(presence, "monotonic_s", lambda: 0.0)
    async with client_of(client.app) as anyone:
        yield World(station, anyone)


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no request get to its route: that it came so far is what counts here."""
    ask = Guard.caller

    async def stop(guard: Guard, request: Request, right: Right, **more: bool) -> Caller:
        found = await ask(guard, request, right, **more)
        path = request.scope["route"].path
        if (request.method, path) in SENDS and not more.get("sends"):
            return found  # the route asks for more, after what stands before it asked who it is
        raise Problem(THROUGH, "It may.")

    monkeypatch.setattr(Guard, "caller", stop)


def held(robot: str, holder: str, who: Someone) -> LeaseRecord:
    """Return the lease of a robot as somebody finds it."""
    at = datetime(2026, 5, 1, tzinfo=UTC)
    match holder:
        case "nobody":
            return LeaseRecord(robot)
        case "the caller":
            return LeaseRecord(robot, "held", who.name, who.kind, who.token, since=at)
        case "another person, who lets the caller act":
            lets = who.token or "token-0"
            return LeaseRecord(
                robot, "held", "zoe", "person", since=at, script=who.name, script_token=lets
            )
        case "another script":
            return LeaseRecord(robot, "held", "other", "script", "token-0", since=at)
        case "another ground station":
            name = "ground station 200"
            return LeaseRecord(robot, "held", name, "station", holder_system=200, since=at)
        case _:
            return LeaseRecord(robot, "held", "zoe", "person", since=at)


async def someone(here: World, kind: str, role: Role, granted: Role) -> Someone:
    """Add a person who is signed in, or a script with a token."""
    foundation, name = here.station.foundation, f"{kind} {role} {granted}"
    given = [] if granted is Role.NONE else [GrantRecord(granted, robot=MINI)]
    now, hour = datetime.now(UTC), timedelta(hours=1)

    def script(session: Session) -> Someone:
        at = foundation.clock.now()
        made = create_token(session, name, role, hour, grants=given, at=at, by="test")
        return Someone(kind, role, granted, name, made.token.id, bearer(made.secret))

    def person(session: Session) -> Someone:
        holder = grants.Holder(person=add_person(session, name, role, None, now).key)
        grants.set_grants(session, holder, given)
        secret, csrf = new_secret(), new_secret()
        digest, end = secret_hash(secret), now + hour
        add_session(session, holder, secret_hash=digest, csrf_token=csrf, at=now, expires_at=end)
        port = httpx.URL(BASE_URL).port or "default"
        cookie = {"Cookie": f"grace_session_{port}={secret}", "X-CSRF-Token": csrf}
        return Someone(kind, role, granted, name, None, cookie)

    return await foundation.store.write(person if kind == "person" else script)


async def callers(here: World) -> list[Someone]:
    return [await someone(here, kind, *rights) for kind, rights in product(KINDS, CALLERS)]


async def routes(here: World) -> list[Case]:
    """Every route about a robot, and the settings of one, which its query names."""

    def add(session: Session) -> dict[str, dict[str, str]]:
        return {robot: ids_of(session, robot) for robot in (MINI, GRACE)}

    things = await here.station.foundation.store.write(add)
    every = list(cases(here.station.foundation.services.get(Subjects), things))
    settings = "/api/config/{kind}"
    for robot in (MINI, GRACE):
        path = f"/api/config/planner?robot={robot}"
        every.append(Case("PATCH", path, settings, robot, RANK[Role.PILOT]))
    return every


def outcomes(case: Case, who: Someone, holder: str) -> set[int]:
    """Return the answers that are right."""
    if not case.may(who.role, who.granted):
        return {403, 404}
    sends = (case.method, case.route) in SENDS
    return {THROUGH} if not sends or who.kind in HOLDERS[holder] else {409}


def worlds(every: list[Someone]) -> Iterator[tuple[Someone, dict[str, str]]]:
    """Yield each caller with who holds each of the two robots: every holder, once for each."""
    names = list(HOLDERS)
    for who in every:
        for number, holder in enumerate(names):
            yield who, {MINI: holder, GRACE: names[(number + 1) % len(names)]}


@pytest.mark.usefixtures("stopped")
@pytest.mark.timeout(900)
async def test_no_request_passes_without_the_right_and_the_lease(here: World):
    every = await routes(here)
    sending = [case for case in every if (case.method, case.route) in SENDS]
    assert {(case.method, case.route) for case in sending} == SENDS
    wrong, asked = [], 0
    for who, holders in worlds(await callers(here)):
        records = {robot: held(robot, name, who) for robot, name in holders.items()}
        for robot, record in records.items():
            await here.put(robot, record)
        for case in every if (who.role, who.granted) in IN_FULL else sending:
            assert case.robot is not None
            status = (await here.ask(who, case.method, case.path)).status_code
            asked += 1
            right = outcomes(case, who, holders[case.robot])
            if status not in right:
                wrong.append((who.name, holders[case.robot], case.method, case.path, status))
            for robot, record in records.items():
                if here.leases.of(robot) != record:  # it was taken by acting
                    assert robot == case.robot, "nobody takes a robot that they did not ask for"
                    assert right == {THROUGH}, "who may not takes nothing"
                    await here.put(robot, record)
    assert not wrong
    assert asked > 5000


@pytest.mark.timeout(900)
async def test_surface_now_is_possible_for_each_pilot_whoever_is_in_charge(here: World):
    boss = await someone(here, "person", Role.ADMIN, Role.VIEWER)
    every = await callers(here)
    for is_held in (False, True):
        if is_held:
            body = {"is_held": True}
            assert (await here.ask(boss, "PUT", "/api/automation", body)).status_code == 200
        for who, holders in worlds(every):
            for robot, holder in holders.items():
                record = held(robot, holder, who)
                await here.put(robot, record)
                path = f"/api/robots/{robot}/commands"
                may = Case("POST", path, path, robot, RANK[Role.PILOT]).may(who.role, who.granted)
                up = await here.ask(who, "POST", path, {"kind": "surface"})
                assert (up.status_code == 202) == may, (who.name, holder, up.text)
                assert may or up.status_code in {403, 404}
                assert here.leases.of(robot) == record, "to surface takes nothing from anybody"
                hold = await here.ask(who, "POST", path, {"kind": "hold"})
                refusal = 409 if not is_held or who.kind == "person" else 423
                lets = who.kind in HOLDERS[holder] and (not is_held or who.kind == "person")
                assert hold.status_code == (202 if lets else refusal) or not may, hold.text
                assert may or hold.status_code in {403, 404}
