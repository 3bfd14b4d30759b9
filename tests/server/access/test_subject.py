"""Every route says whose robots it is about, so that one place asks for the right on them."""

import re

import pytest
from fastapi.routing import APIRoute, APIWebSocketRoute
from starlette.requests import HTTPConnection

from db.fault import UnknownIdError
from server.access.guard import Guard, RobotAsk
from server.access.subject import Subjects
from server.base.problem import Problem
from server.station import ROUTERS
from tests.server.conftest import MINI, StationClient
from tests.server.station_parts import OpenStation

ROUTES = [
    route
    for router in ROUTERS
    for route in router.routes
    if isinstance(route, APIRoute | APIWebSocketRoute)
]


def parameters_of(path: str) -> list[str]:
    return re.findall(r"{(\w+)", path)


async def test_no_route_has_a_parameter_that_nobody_resolves(station: OpenStation):
    subjects = station.foundation.services.get(Subjects)
    unknown = {
        f"{route.path}: {parameter}"
        for route in ROUTES
        for parameter in parameters_of(route.path)
        if not subjects.is_known(parameter)
    }
    assert not unknown, "register it in the install.py of its capability (server/access/subject.py)"


async def test_parameter_of_a_new_route_that_nobody_registered_is_found(station: OpenStation):
    assert not station.foundation.services.get(Subjects).is_known("anchor")


async def test_id_leads_to_its_robot_in_path_and_query(client: StationClient, station: OpenStation):
    created = await client.post(
        "/api/deployments",
        json={"robot": "grace-1", "started_at": None},
    )
    assert created.status_code == 201, created.text
    deployment = created.json()["id"]
    subjects = station.foundation.services.get(Subjects)

    def asked(query: str, path: str = "/api/events", **parameters: str) -> HTTPConnection:
        route = next(one for one in ROUTES if one.path == path)
        scope = {"type": "http", "query_string": query.encode(), "route": route, "headers": []}
        return HTTPConnection({**scope, "path_params": parameters})

    by_path = await subjects.of(asked("", deployment=deployment, number="3"))
    assert [one.robots for one in by_path] == [frozenset({"grace-1"})]
    by_both = await subjects.of(asked(f"deployment={deployment}&limit=3", robot=MINI))
    assert {robot for one in by_both for robot in one.robots} == {MINI, "grace-1"}
    with pytest.raises(UnknownIdError):
        await subjects.of(asked("", deployment="deployment-999"))
    assert await subjects.of(asked(f"robot={MINI}", "/api/people")) == []


async def test_check_has_the_last_word_on_requests_about_robots(
    client: StationClient, station: OpenStation
):
    asked: list[RobotAsk] = []

    async def refuse(ask: RobotAsk) -> None:
        asked.append(ask)
        if ask.right != "view":
            raise Problem(409, "Somebody else has it.")

    station.foundation.services.get(Guard).add_check(refuse)
    assert (await client.get(f"/api/robots/{MINI}")).status_code == 200
    assert (await client.get("/api/robots")).status_code == 200
    assert not asked, "to look sends no robot anything"
    refused = await client.post(f"/api/robots/{MINI}/commands", json={"kind": "hold"})
    assert refused.status_code == 409
    body = {"robots": [MINI, "grace-1"], "automation": True}
    surveys = await client.post("/api/surveys", json=body)
    assert surveys.status_code == 409
    assert asked[-1].robots == frozenset({MINI, "grace-1"})
    settings = await client.patch("/api/config/planner?robot=mini-9", json={})
    assert settings.status_code == 409
