"""What a plan is refused for before anything is searched."""

import pytest

from tests.server.conftest import FAST


async def refused(client, **config):
    body = {"kind": "adaptive_survey", "config": {**FAST, **config}}
    return await client.post("/api/robots/mini-1/plans", json=body)


async def test_robot_inside_a_keep_out_is_refused_by_the_keep_out(client):
    corners = [[1.0, 0.4], [1.5, 0.4], [1.5, 0.8], [1.0, 0.8]]
    far = [[2.0, 0.1], [2.2, 0.1], [2.2, 0.3]]
    keep_outs = [{"name": "ladder", "corners_m": far}, {"name": "net", "corners_m": corners}]
    answer = await refused(client, keep_outs=keep_outs)
    assert answer.status_code == 422
    errors = answer.json()["errors"]
    assert [error["loc"] for error in errors] == [["config", "keep_outs", 1]]
    assert "inside the keep-out net" in errors[0]["msg"]


async def test_budget_below_the_cheapest_primitive_is_refused_with_its_least(client):
    answer = await refused(client, total_budget=0.5, round_budget=0.5)
    assert answer.status_code == 422
    errors = answer.json()["errors"]
    assert [error["loc"] for error in errors] == [["config", "round_budget"]]
    assert "energy units" in errors[0]["msg"]


@pytest.mark.parametrize(
    ("config", "field"),
    [
        ({"target_std": -1.0}, "target_std"),
        ({"time_budget_s": -1.0}, "time_budget_s"),
        ({"satellite_bytes": 1.5}, "satellite_bytes"),
        ({"domain": {"x_min_m": 1.0, "x_max_m": 1.0}}, "domain"),
    ],
)
async def test_wrong_settings_are_named_by_their_field(client, config, field):
    answer = await refused(client, **config)
    assert answer.status_code == 422
    assert all(error["loc"][:2] == ["config", field] for error in answer.json()["errors"])


def dive(depth_m, **more):
    return {"kind": "dive", "end_ned": [0.0, 0.0, depth_m], **more}


@pytest.mark.parametrize(
    ("legs", "config", "where"),
    [
        ([dive(1e300)], {}, ["legs", 0, "end_ned", 2]),
        ([{"kind": "glide", "end_ned": [9e5, 0.0, 0.3]}, dive(0.0)], {}, ["legs"]),
        ([dive(0.3, speed_m_s=1e-12), dive(0.0)], {}, ["legs"]),
        ([dive(0.3), dive(0.0)], {"primitives": {"point_interval_s": 1e-12}}, ["legs"]),
        (
            [{"kind": "swim", "end_ned": [1.5, 0.6, 0.0]}],
            {"current": {"north_m_s": -0.9}},
            ["legs", 0, "end_ned"],
        ),
    ],
)
async def test_legs_without_measure_are_refused_by_what_is_wrong_of_them(
    client, legs, config, where
):
    body = {"kind": "primitives", "legs": legs, "config": config}
    answer = await client.post("/api/robots/mini-1/plans", json=body)
    assert answer.status_code == 422
    [error] = answer.json()["errors"]
    assert [part for part in error["loc"] if part != "primitives"] == where
