"""Where the field is above a value, and how much of the water that is."""

import numpy as np
import pytest

from autonomy.field.threshold import drawn_fields, level_of, share_above
from benchmarks.field.field_threshold import probability_above
from server.map import threshold
from tests.server.conftest import MINI, until

PLACES = [(north, east, 0.2) for north in (0.4, 1.2, 2.0) for east in (0.3, 0.8)]


@pytest.fixture
async def mapped(client, world):
    """Let the map of the tank be bright in the south and dim in the north."""
    for north, east, depth_m in PLACES:
        value = 200.0 if north < 1.0 else 20.0
        world.robots[MINI].sample((north, east, depth_m), value=value)

    async def has_them():
        found = (await client.get(f"/api/robots/{MINI}/maps/blue_light")).json()
        return found.get("samples", {}).get("total") == len(PLACES)

    await until(has_them)
    return f"/api/robots/{MINI}/maps/blue_light"


async def share(client, path, **query):
    answer = await client.get(f"{path}/share", params=query)
    assert answer.status_code == 200, answer.text
    return answer.json()


async def test_share_of_the_water_above_a_value_is_told_with_its_doubt(client, mapped):
    found = await share(client, mapped, above=60.0)
    assert (found["above"], found["unit"], found["draws"]) == (60.0, "counts", 200)
    assert 0.0 <= found["low"] < found["high"] <= 1.0
    assert found["points"] <= 420
    lower, higher = (
        await share(client, mapped, above=20.0),
        await share(client, mapped, above=180.0),
    )
    assert higher["low"] <= found["low"] <= lower["low"]
    assert higher["high"] <= found["high"] <= lower["high"]
    assert await share(client, mapped, above=60.0) == found
    everything = await share(client, mapped, above=-1.0)
    assert (everything["low"], everything["high"]) == (1.0, 1.0)


async def test_threshold_is_a_setting_that_leaves_the_map_alone(client, mapped, station):
    refused = await client.get(f"{mapped}/share")
    assert refused.status_code == 409
    assert "No threshold is set" in refused.json()["detail"]
    group = station.maps.group(MINI)
    live = group.live
    patched = await client.patch(f"/api/config/field?robot={MINI}", json={"threshold": 60.0})
    assert patched.status_code == 200, patched.text

    async def is_told():
        return (await client.get(mapped)).json()["threshold"] == 60.0

    await until(is_told)
    assert station.maps.group(MINI) is group
    assert group.live is live
    assert (await share(client, mapped))["above"] == 60.0


async def test_map_that_grows_fast_is_drawn_from_now_and_then(client, mapped, world, monkeypatch):
    monkeypatch.setattr(threshold, "_REST_FACTOR", 1e9)
    before = await share(client, mapped, above=60.0)
    world.robots[MINI].sample((1.0, 0.5, 0.3), value=500.0)

    async def has_it():
        return (await client.get(mapped)).json()["samples"]["total"] == len(PLACES) + 1

    await until(has_it)
    assert await share(client, mapped, above=60.0) == before


async def test_no_map_has_no_share(client):
    answer = await client.get(f"/api/robots/{MINI}/maps/chlorophyll/share", params={"above": 1.0})
    assert answer.status_code == 404
    nothing = await client.get(f"/api/robots/{MINI}/maps/blue_light/share?above=nan")
    assert nothing.status_code == 422


def test_drawn_fields_have_the_map_s_mean_and_covariance():
    rng = np.random.default_rng(1)
    root = rng.standard_normal((5, 5))
    mean, covariance = np.arange(5.0), root @ root.T
    fields = drawn_fields(mean, covariance, 20_000, rng)
    np.testing.assert_allclose(fields.mean(axis=0), mean, atol=0.1)
    np.testing.assert_allclose(np.cov(fields.T), covariance, atol=0.35)
    alike = np.ones((4, 4))  # has no factor of its own
    together = drawn_fields(np.zeros(4), alike, 100, rng)
    assert np.ptp(together, axis=1).max() < 1e-2
    with pytest.raises(ValueError, match="positive definite"):
        drawn_fields(np.zeros(2), np.array([[1.0, 3.0], [3.0, 1.0]]), 10, rng)


def test_points_that_are_wrong_together_leave_more_doubt_of_the_share():
    rng, mean = np.random.default_rng(2), np.zeros(100)
    apart = share_above(0.0, drawn_fields(mean, np.eye(100), 200, rng))
    together = share_above(0.0, drawn_fields(mean, 0.99 * np.ones((100, 100)), 200, rng))
    assert apart[1] - apart[0] < 0.25
    assert together == (0.0, 1.0)


def test_probability_counts_in_the_scale_of_the_model():
    assert probability_above(level_of("log", 10.0), np.log([10.0]), np.ones(1)) == 0.5
    assert probability_above(level_of("linear", 3.0), np.array([4.0]), np.ones(1)) == pytest.approx(
        0.8413447
    )
    assert probability_above(level_of("log", 0.0), np.zeros(1), np.ones(1)) == 1.0
