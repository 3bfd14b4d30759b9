"""The current of a robot's water: what is known of it, on a grid and at a place."""

import asyncio
from datetime import UTC, datetime
from enum import StrEnum
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Depends, Query, Response
from pydantic import AwareDatetime

from server.access.dependency import Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import FoundationDep, service
from server.base.problem import conflict, not_found
from server.base.view import encoded
from server.current import words
from server.current.currents import Currents
from server.current.flow import arrows, flow_grid, table
from server.current.view import CurrentStatusView, CurrentWorthView, FlowAtView, FlowView
from server.current.water_current import WaterCurrent
from server.fleet.dependency import FleetDep

router = APIRouter(prefix="/api/robots/{robot}/current", tags=["maps"], route_class=IdempotentRoute)

CurrentsDep = Annotated[Currents, Depends(service(Currents))]
Moment = Annotated[AwareDatetime | None, Query(description="By default now; RFC 3339.")]


class FlowFormat(StrEnum):
    """How a flow is written."""

    JSON = "json"
    CSV = "csv"
    """One row for each place, eastward and northward with their standard errors."""


@router.get("")
async def get_current(
    caller: Viewer, robot: str, fleet: FleetDep, currents: CurrentsDep, foundation: FoundationDep
) -> CurrentStatusView:
    """Return what is known of the current of a robot's water, in figures and in words."""
    del caller
    status = fleet.status(robot)
    found = _found(currents, robot)
    now_s = foundation.clock.now().timestamp()
    state = status.state
    texts = [words.dives_text(found)]
    if state is not None and found.tells(now_s):
        place = state.position_ned
        texts.append(await asyncio.to_thread(words.place_text, found.known, robot, place, now_s))
        texts.append(await asyncio.to_thread(words.tide_text, found.known, place, now_s))
    return _view(
        found, robot, " ".join(filter(None, texts)), now_s, _is_simulation(foundation, found)
    )


@router.get("/worth")
async def get_current_worth(
    caller: Viewer,
    robot: str,
    fleet: FleetDep,
    currents: CurrentsDep,
    foundation: FoundationDep,
    north_m_s: Annotated[float, Query(ge=-3.0, le=3.0)] = 0.0,
    east_m_s: Annotated[float, Query(ge=-3.0, le=3.0)] = 0.0,
) -> CurrentWorthView:
    """Return what no current, a typed one and that of the dives are worth to a plan, in words."""
    del caller
    fleet.status(robot)
    found, now_s = _found(currents, robot), foundation.clock.now().timestamp()
    said = await asyncio.to_thread(words.worth_of, found, (north_m_s, east_m_s), now_s)
    return CurrentWorthView(robot, said.none, said.typed, said.map, found.is_usable(now_s))


@router.get("/flow", response_model=FlowView, responses={200: {"content": {"text/csv": {}}}})
async def get_flow(
    caller: Viewer,
    robot: str,
    fleet: FleetDep,
    currents: CurrentsDep,
    foundation: FoundationDep,
    at: Moment = None,
    format: Annotated[FlowFormat, Query()] = FlowFormat.JSON,
) -> Response:
    """Return the depth-averaged current on a grid over the domain, with its doubt."""
    del caller
    record, found = fleet.status(robot).record, _found(currents, robot)
    now = foundation.clock.now()
    when = at or now
    is_simulation = _is_simulation(foundation, found)
    if format is FlowFormat.CSV:
        _refuse_without_map(found, when)
    if not found.tells(when.timestamp()):
        nothing = FlowView(robot, record.site.name, when, when > now, False, 0.0, [], is_simulation)
        return encoded(nothing)
    grid = await asyncio.to_thread(flow_grid, found.known, record.site, when.timestamp())
    mark = "_SIMULATION" if is_simulation else ""
    if format is FlowFormat.CSV:
        text = table(grid, record.site, when, is_simulation=is_simulation)
        named = {"Content-Disposition": f'attachment; filename="{robot}_current{mark}.csv"'}
        return Response(text.encode(), media_type="text/csv; charset=utf-8", headers=named)
    return encoded(
        FlowView(
            robot=robot,
            site=record.site.name,
            at=when,
            is_predicted=when > now,
            is_tabulated=True,
            spacing_m=grid.spacing_m,
            arrows=await asyncio.to_thread(arrows, grid),
            simulation=is_simulation,
        )
    )


@router.get("/at")
async def get_flow_at(
    caller: Viewer,
    robot: str,
    fleet: FleetDep,
    currents: CurrentsDep,
    foundation: FoundationDep,
    north_m: Annotated[float, Query(ge=-1e7, le=1e7)],
    east_m: Annotated[float, Query(ge=-1e7, le=1e7)],
    depth_m: Annotated[float, Query(ge=0.0, le=12_000.0)] = 0.0,
    at: Moment = None,
) -> FlowAtView:
    """Return the current at a place, depth and time, with its standard deviation."""
    del caller
    fleet.status(robot)
    found, when = _found(currents, robot), at or foundation.clock.now()
    _refuse_without_map(found, when)
    known = found.known
    point = np.array([[north_m, east_m, depth_m, when.timestamp()]])
    flow = await asyncio.to_thread(known.flow, point)
    north, east = flow.mean_ne_m_s[0].tolist()
    std = np.sqrt(np.maximum(np.diag(flow.cov_m2_s2[0]), 0.0)).tolist()
    return FlowAtView((north, east), (std[0], std[1]), when)


def _refuse_without_map(found: WaterCurrent, when: datetime) -> None:
    if not found.tells(when.timestamp()):
        raise conflict(f"There is no map of the current. {words.dives_text(found)}")


def _found(currents: Currents, robot: str) -> WaterCurrent:
    found = currents.of(robot)
    if found is None:
        raise not_found(f"Nothing is known of the current at {robot}.")
    return found


def _is_simulation(foundation: FoundationDep, found: WaterCurrent) -> bool:
    return foundation.settings.simulation or found.water.kind == "simulated"


def _view(
    found: WaterCurrent, robot: str, text: str, now_s: float, simulation: bool
) -> CurrentStatusView:
    known, dives, verdicts = found.known, found.dives, list(found.verdicts)
    newest_s = known.newest_s
    return CurrentStatusView(
        robot=robot,
        site=found.water.name,
        is_enabled=found.config.enabled,
        is_usable=found.is_usable(now_s),
        dives=len(dives),
        stays=len(known.observations) - len(dives),
        robots=sorted({one.robot for one in dives}),
        oldest_at=datetime.fromtimestamp(known.oldest_s, UTC) if known.observations else None,
        newest_at=datetime.fromtimestamp(newest_s, UTC) if known.observations else None,
        text=text,
        worth=words.worth_text(verdicts),
        told=words.told_words(found, now_s),
        left_out=words.left_out_text(found.left_out),
        error_m=words.rms([one.error_m for one in verdicts]),
        last_error_m=words.rms([one.last_error_m for one in verdicts]),
        judged=len(verdicts),
        prior_std_m_s=known.prior_std_m_s(),
        learned=known.learned,
        simulation=simulation,
    )
