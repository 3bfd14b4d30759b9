"""Plans in the current that finished dives tell of."""

from datetime import UTC, datetime

import numpy as np
import pytest

from autonomy.current.config import CurrentMapConfig
from autonomy.current.model import CurrentMap
from autonomy.current.table import flow_at
from autonomy.planner.config import PlannerConfig
from autonomy.planner.preset import planner_preset
from autonomy.site import LAKE
from robot_link.dry_run import DryRunProblem
from server.current.currents import Currents
from server.plan.document import legs_of, mission_of, points_of
from server.plan.dry_run import DryRuns
from server.plan.flow import PlanFlows, round_duration_s, surfacings_of
from server.plan.primitive_legs import LegRequest, candidate_of, legs_from
from simulator.flow import Tabled
from tests.autonomy.test_current_map import observation
from tests.autonomy.test_planner_flow import flow_record
from tests.server.conftest import GRACE, until
from tests.server.fake_link import state_report

LAKE_PLANNER = planner_preset("grace3", "lake")
DIVE = (
    LegRequest("glide", (215.0, 200.0, 8.0)),
    LegRequest("glide", (230.0, 200.0, 0.0)),
)


def told(dives: int, now_s: float) -> CurrentMap:
    known = CurrentMap(CurrentMapConfig())
    for i in range(dives):
        start_s = now_s - 600.0 * (dives - i)
        known.append(
            observation(start_s, (20.0, -8.0), (200.0, 180.0), robot=GRACE, walk_std_m=3.0)
        )
    return known


def test_dives_come_up_within_ellipses_that_the_map_states() -> None:
    now_s = datetime.now(UTC).timestamp()
    known = told(8, now_s)
    legs = legs_from(LAKE_PLANNER, (200.0, 200.0), DIVE)
    (one,) = surfacings_of(known, LAKE_PLANNER, legs, now_s)
    duration_s = sum(leg.duration_s for leg in legs)
    assert one["leg"] == 1
    expected = np.array([20.0, -8.0]) / 400.0 * duration_s
    np.testing.assert_allclose(one["drift_ne_m"], expected, atol=0.2 * np.hypot(*expected))
    major, minor = one["ellipse_m"]
    walked = LAKE_PLANNER.position_filter.drift_m_sqrt_s * np.sqrt(duration_s)
    assert major >= minor > walked


async def test_plan_takes_the_map_once_it_tells_enough(station, world) -> None:
    flows = PlanFlows(station.foundation)
    config = PlannerConfig.model_validate(
        LAKE_PLANNER.model_dump() | {"current": {"source": "map", "north_m_s": 0.02}}
    )
    typed = await flows.planned(GRACE, LAKE_PLANNER, 0.0)
    assert typed.config == LAKE_PLANNER
    assert typed.text == ""
    early = await flows.planned(GRACE, config, 0.0)
    assert early.config.current.flow is None
    assert early.text.startswith("The map of the current tells too little for a plan (0 dives")
    still = config.model_copy(
        update={"current": config.current.model_copy(update={"source": "none"})}
    )
    calm = await flows.planned(GRACE, still, 0.0)
    assert calm.text == ""
    assert flow_at(calm.config.current.table, 0.0, 0.0, 0.0, 0.0) == (0.0, 0.0)
    assert flow_at(config.current.table, 0.0, 0.0, 0.0, 0.0) == (0.02, 0.0)
    now_s = station.foundation.clock.now().timestamp()
    found = station.foundation.services.get(Currents).of(GRACE)
    found.known = told(8, now_s)
    planned = await flows.planned(GRACE, config, 30.0)
    later_s = station.foundation.clock.now().timestamp()
    flow = planned.config.current.flow
    assert planned.text == "Planned in the current that 8 dives tell of."
    assert now_s + 29.0 <= flow.from_s <= later_s + 31.0
    assert flow.duration_s == pytest.approx(1.5 * round_duration_s(config))
    again = await flows.planned(
        GRACE, planned.config.model_copy(update={"current": LAKE_PLANNER.current}), 0.0
    )
    assert again.config.current.flow is None


async def test_laid_out_plan_says_where_its_dives_come_up(client, station, world) -> None:
    world.tell(state_report(GRACE, (200.0, 200.0, 0.0), position_std_m=1.5))
    await until(lambda: station.fleet.status(GRACE).state)
    now_s = station.foundation.clock.now().timestamp()
    found = station.foundation.services.get(Currents).of(GRACE)
    found.known = told(8, now_s)
    asked = {
        "kind": "primitives",
        "config": {"current": {"source": "map"}, "adaptive": {"rehearse": False}},
        "legs": [
            {"kind": "glide", "end_ned": [215.0, 200.0, 8.0]},
            {"kind": "glide", "end_ned": [230.0, 200.0, 0.0]},
        ],
    }
    made = await client.post("/api/robots/grace-1/plans", json=asked)
    assert made.status_code < 300, made.text
    plan = (await client.get(f"/api/plans/{made.json()['id']}")).json()
    assert plan["current_text"] == "Planned in the current that 8 dives tell of."
    assert "flow" not in plan["config"]["current"]
    (one,) = plan["comes_up"]
    end = plan["points"][-1]
    assert (one["north_m"], one["east_m"]) == pytest.approx((end[1], end[2]), abs=0.5)
    assert end[1] > 231.0  # carried north
    record = await station.plans.get(plan["id"])
    config = PlannerConfig.model_validate(record.config)
    assert config.current.flow is not None
    problem = DryRuns(station.fleet, station.workers).problem(
        "grace-1", mission_of(record), points_of(record.document), config
    )
    assert isinstance(problem, DryRunProblem)
    assert problem.flow == config.current.flow
    assert len(legs_of(record.document)) == len(mission_of(record).legs) == 2


def test_rehearsed_water_flows_as_the_table_says() -> None:
    values = np.zeros((2, 2, 2, 2, 2))
    values[1, :, :, :, 0] = 0.1
    current = LAKE_PLANNER.current.model_copy(update={"flow": flow_record(values)})
    flow = Tabled(current.table)
    domain = LAKE.domain
    north = np.array([domain.x_min_m, 0.5 * (domain.x_min_m + domain.x_max_m), domain.x_max_m])
    found = flow.velocity_ne_m_s(np.array([[one, 100.0, 3.0, 50.0] for one in north]))
    np.testing.assert_allclose(found, [[0.0, 0.0], [0.05, 0.0], [0.1, 0.0]], atol=1e-7)
    config = LAKE_PLANNER.model_copy(update={"current": current})
    candidate = candidate_of(config, legs_from(config, (200.0, 200.0), DIVE))
    assert candidate.points[-1, 1] > 230.0
