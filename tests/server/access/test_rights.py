"""Nothing may that may not: every route, every role, every right on a robot.

What is expected here is worked out from ranks alone, not from the code that decides.
"""

import re
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta

import httpx
import pytest
from fastapi.routing import APIRoute
from sqlalchemy.orm import Session
from starlette.requests import Request
from starlette.websockets import WebSocket

from autonomy.tag.config import TagConfig
from db.query.station.grants import GrantRecord
from server.access.caller import Caller
from server.access.dependency import right_of
from server.access.guard import Guard
from server.access.register import create_token
from server.access.role import Right, Rights, Role
from server.access.subject import Subjects
from server.base.problem import Problem
from server.fleet.fleet import Fleet
from server.fleet.water import site_robots
from server.tag.route import Question
from tests.server.access.rows import ids_of
from tests.server.access.test_subject import ROUTES, parameters_of
from tests.server.conftest import GRACE, MINI, StationClient
from tests.server.station_app import bearer, client_of
from tests.server.station_parts import OpenStation

RANK = {Role.NONE: 0, Role.VIEWER: 1, Role.PILOT: 2, Role.ADMIN: 3}
NEEDED = {Right.VIEW: 1, Right.PILOT: 2, Right.ADMINISTER: 3}
CALLERS = [
    (role, granted)
    for role in Role
    for granted in Role
    if granted is Role.NONE or RANK[granted] > RANK[role]
]
THROUGH = 418
OPEN_TO_ALL = {
    "/api/session", "/api/session/first", "/api/session/provider", "/sign-in", "/sign-in/oidc",
    "/sign-in/oidc/back", "/api/health", "/docs", "/ack/style.css", "/ack/{word}",
}  # fmt: skip
READS_ROBOT = {"/api/config/{kind}", "/api/alarm-rules/{rule}/out-of-service"}
"""Changes of the station or, by their query, of one robot."""
WEBSOCKETS = {
    "/api/live": 1,
    "/view/{robot}": 1,
    "/view/{robot}/replay/{tab}": 1,
    "/api/robots/{robot}/drive": 2,
}
"""Rank that each of them needs."""


@dataclass(frozen=True)
class Case:
    """A request to a route, and from which ranks on it may pass."""

    method: str
    path: str
    route: str
    robot: str | None
    needed: int

    def may(self, role: Role, granted: Role) -> bool:
        on_it = granted if self.robot == MINI else Role.NONE
        return max(RANK[role], RANK[on_it]) >= self.needed


@pytest.fixture
async def things(station: OpenStation) -> dict[str, dict[str, str]]:
    def add(session: Session) -> dict[str, dict[str, str]]:
        return {robot: ids_of(session, robot) for robot in (MINI, GRACE)}

    return await station.foundation.store.write(add)


@pytest.fixture
async def anyone(client: StationClient) -> AsyncIterator[httpx.AsyncClient]:
    async with client_of(client.app) as anyone:
        yield anyone


async def secret_of(station: OpenStation, role: Role, granted: Role) -> str:
    foundation = station.foundation
    grants = [] if granted is Role.NONE else [GrantRecord(granted, robot=MINI)]

    def create(session: Session) -> str:
        at, name = foundation.clock.now(), f"{role} with {granted}"
        hour = timedelta(hours=1)
        return create_token(session, name, role, hour, grants=grants, at=at, by="test").secret

    return await foundation.store.write(create)


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no request get to its route: that it came so far is what counts here."""
    ask = Guard.caller

    async def stop(guard: Guard, request: Request, right: Right, **more: bool) -> Caller:
        await ask(guard, request, right, **more)
        raise Problem(THROUGH, "It has the right.")

    monkeypatch.setattr(Guard, "caller", stop)


def filled(path: str, ids: dict[str, str]) -> str:
    """Put ids into a route's path; 1 for what is named by none."""
    return re.sub(r"{(\w+)[^}]*}", lambda found: ids.get(found[1], "1"), path)


def cases(subjects: Subjects, things: dict[str, dict[str, str]]) -> Iterator[Case]:
    """Every route about a robot, once for a thing of each."""
    for route in ROUTES:
        if not isinstance(route, APIRoute) or (right := right_of(route.dependant)) is None:
            continue
        names = parameters_of(route.path)
        if not any(subjects.is_of_a_robot(name) for name in names):
            continue
        for robot, ids in things.items():
            path = filled(route.path, ids)
            for method in route.methods:
                yield Case(method, path, route.path, robot, NEEDED[right])


@pytest.mark.usefixtures("stopped")
async def test_no_request_about_a_robot_passes_without_the_right_on_it(
    station: OpenStation, anyone: httpx.AsyncClient, things: dict[str, dict[str, str]]
):
    every = list(cases(station.foundation.services.get(Subjects), things))
    assert len({case.route for case in every}) > 90
    wrong = []
    for role, granted in CALLERS:
        headers = bearer(await secret_of(station, role, granted))
        for case in every:
            status = (await anyone.request(case.method, case.path, headers=headers)).status_code
            has_passed = status in {THROUGH, 409}  # 409: somebody must be in charge first
            if has_passed != case.may(role, granted) or not (has_passed or status in {403, 404}):
                wrong.append((role, granted, case.method, case.path, status))
    assert not wrong
    assert {(await anyone.request(one.method, one.path)).status_code for one in every} == {401}


async def test_no_request_about_the_station_passes_by_a_right_on_a_robot(
    station: OpenStation, anyone: httpx.AsyncClient
):
    subjects = station.foundation.services.get(Subjects)
    of_station = [
        (method, route.path, NEEDED[right])
        for route in ROUTES
        if isinstance(route, APIRoute) and (right := right_of(route.dependant)) is not None
        for method in route.methods
        if not any(subjects.is_of_a_robot(name) for name in parameters_of(route.path))
        and not subjects.asks_itself(method, route.path)
        and right is not Right.VIEW
    ]
    assert len(of_station) > 25
    for role, granted in CALLERS:
        headers = bearer(await secret_of(station, role, granted))
        for method, template, needed in of_station:
            if RANK[role] >= needed:
                continue
            for query in ("",) if template in READS_ROBOT else ("", f"?robot={MINI}"):
                path = filled(template, {}) + query
                answer = await anyone.request(method, path, headers=headers)
                assert answer.status_code == 403, (role, granted, method, path, answer.text)


async def test_every_route_asks_for_a_right_or_is_known_to_ask_for_none():
    open_to_all = {
        route.path
        for route in ROUTES
        if isinstance(route, APIRoute)
        and right_of(route.dependant) is None
        and not route.path.startswith("/api/gateways/")  # the push of a gateway brings a secret
    }
    assert open_to_all == OPEN_TO_ALL
    assert {r.path for r in ROUTES if not isinstance(r, APIRoute)} == set(WEBSOCKETS)


@pytest.mark.parametrize("path", WEBSOCKETS)
async def test_no_stream_opens_without_the_right(
    station: OpenStation, client: StationClient, path: str
):
    guard = station.foundation.services.get(Guard)
    right = next(right for right, rank in NEEDED.items() if rank == WEBSOCKETS[path])
    robots = [MINI, GRACE] if "{robot}" in path else [None]
    for role, granted in CALLERS:
        secret = await secret_of(station, role, granted)
        for robot in robots:
            bearing = (b"authorization", f"Bearer {secret}".encode())
            scope = {
                "type": "websocket",
                "app": client.app,
                "path": path,
                "headers": [(b"host", b"127.0.0.1"), bearing],
                "query_string": b"",
                "path_params": {} if robot is None else {"robot": robot},
            }
            may = robot is None or Case("", "", path, robot, WEBSOCKETS[path]).may(role, granted)
            if robot is None and (role, granted) == (Role.NONE, Role.NONE):
                may = False
            opened = False
            with suppress(Exception):
                await guard.websocket_caller(WebSocket(scope, _nothing, _nothing), right)
                opened = True
            assert opened == may, (role, granted, robot)


async def _nothing(*_: object) -> dict[str, str]:
    return {"type": "websocket.disconnect"}


async def test_body_that_names_a_foreign_robot_is_refused(
    station: OpenStation, anyone: httpx.AsyncClient
):
    headers = bearer(await secret_of(station, Role.NONE, Role.PILOT))

    async def status(path: str, **sent: object) -> int:
        return (await anyone.post(path, headers=headers, **sent)).status_code

    assert await status("/api/deployments", json={"robot": GRACE}) == 404
    assert await status("/api/deployments", json={"robot": MINI}) == 201
    assert await status("/api/surveys", json={"robots": [MINI, GRACE]}) == 404
    sheet = {"file": ("a.csv", b"time,latitude,longitude,depth\n")}
    assert await status("/api/imports", files=sheet, data={"robot": GRACE}) == 404
    assert await status("/api/imports", files=sheet, data={"robot": MINI}) == 202
    viewer = bearer(await secret_of(station, Role.VIEWER, Role.NONE))
    refused = await anyone.post("/api/deployments", headers=viewer, json={"robot": MINI})
    assert refused.status_code == 403


async def test_query_that_names_a_foreign_robot_or_its_things_is_refused(
    station: OpenStation, anyone: httpx.AsyncClient, things: dict[str, dict[str, str]]
):
    headers = bearer(await secret_of(station, Role.NONE, Role.ADMIN))
    foreign = things[GRACE]
    for path in (
        f"/api/robots/{MINI}/tracking?plan={foreign['plan']}",
        f"/api/robots/{MINI}/track?deployment={foreign['deployment']}",
        f"/api/config/planner?robot={GRACE}",
        f"/api/journal?robot={GRACE}",
        f"/api/events?robot={GRACE}",
        f"/api/events?deployment={foreign['deployment']}",
        f"/view/?robot={GRACE}",
        f"/api/robots/{MINI}/parameters?against={GRACE}",
        f"/api/designs/{things[MINI]['design']}/difference?first=plan:{foreign['plan']}",
    ):
        assert (await anyone.get(path, headers=headers)).status_code == 404, path
    for named in ({"design": foreign["design"]}, {"plan": foreign["plan"]}):
        begun = {"name": "copy", **named}
        answer = await anyone.post(f"/api/robots/{MINI}/designs", headers=headers, json=begun)
        assert answer.status_code == 404, named
    for path in ("/api/journal", "/api/journal.tlog", "/api/events/export"):
        assert (await anyone.get(path, headers=headers)).status_code == 403, path
    patch = {"json": {}, "headers": headers}
    assert (await anyone.patch("/api/config/planner", **patch)).status_code == 403
    assert (await anyone.patch(f"/api/config/planner?robot={MINI}", **patch)).status_code == 200


async def test_foreign_and_unknown_robot_are_answered_alike(
    station: OpenStation, anyone: httpx.AsyncClient, things: dict[str, dict[str, str]]
):
    headers = bearer(await secret_of(station, Role.NONE, Role.VIEWER))
    plan = things[GRACE]["plan"]
    for foreign, unknown, path in (
        (GRACE, "robot-9", "/api/robots/{}"),
        (plan, "plan-999", "/api/plans/{}"),
    ):
        answers = [
            (await anyone.get(path.format(name), headers=headers)) for name in (foreign, unknown)
        ]
        first, second = (
            (one.status_code, one.json()["detail"].replace(name, "it"))
            for one, name in zip(answers, (foreign, unknown), strict=True)
        )
        assert first == second


async def test_abort_is_always_possible_for_a_pilot(
    station: OpenStation, anyone: httpx.AsyncClient
):
    for role, granted in CALLERS:
        headers = bearer(await secret_of(station, role, granted))
        path = f"/api/robots/{MINI}/commands"
        answer = await anyone.post(path, json={"kind": "surface"}, headers=headers)
        may = max(RANK[role], RANK[granted]) >= RANK[Role.PILOT]
        assert (answer.status_code < 300) == may, (role, granted, answer.text)


async def test_lists_tell_nothing_of_robots_that_one_may_not_see(
    station: OpenStation,
    client: StationClient,
    anyone: httpx.AsyncClient,
    things: dict[str, dict[str, str]],
):
    await station.foundation.alarms.raise_("test", f"{GRACE} leaks.", robot=GRACE)
    headers = bearer(await secret_of(station, Role.NONE, Role.PILOT))
    telling = set()
    for route in ROUTES:
        if not isinstance(route, APIRoute) or "GET" not in route.methods:
            continue
        ids = things[MINI]
        path = filled(route.path, ids)
        if route.path in {"/docs", "/sign-in", "/sign-in/oidc", "/sign-in/oidc/back"}:
            continue
        seen = await anyone.get(path, headers=headers)
        assert GRACE not in seen.text, path
        if "{" not in route.path:
            whole = await anyone.get(path, headers=bearer(client.secret))
            telling |= {path} if GRACE in whole.text else set()
    assert {
        "/api/robots", "/api/alarms", "/api/events", "/api/deployments", "/api/waters",
        "/api/config",
    } <= telling  # fmt: skip


async def test_detections_of_a_water_are_those_of_robots_that_one_may_see(station: OpenStation):
    record = station.foundation.services.get(Fleet).status(MINI).record

    async def heard_by(rights: Rights) -> list[str]:
        question = Question(rights, record, TagConfig(), None, None, "water")
        return list(await station.foundation.store.query(question.robots))

    everybody = await station.foundation.store.query(lambda session: site_robots(session, MINI))
    assert await heard_by(Rights(Role.VIEWER)) == list(everybody)
    assert await heard_by(Rights(Role.NONE, {MINI: Role.VIEWER})) == [MINI]
    assert await heard_by(Rights(Role.NONE, {GRACE: Role.VIEWER})) == [
        robot for robot in everybody if robot == GRACE
    ]
