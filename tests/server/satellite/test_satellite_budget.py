"""What plans by satellite cost, and the budget of a day that stops them."""

from robot_link.messages import CommandKind
from tests.server.conftest import until
from tests.server.far import (
    draft,
    queued,
    settled,
    transfer_of,
)


async def test_quote_is_what_the_gateway_is_asked_to_take(far, sky):
    station, client = far
    plan = await draft(client)
    quote = (await client.get(f"/api/plans/{plan['id']}/satellite")).json()
    assert quote["refusal"] is None
    assert quote["auto"]["route"] == "satellite"
    assert sky.calls == [], "asking sends nothing"
    _, found = await queued(station, client, sky, plan)
    assert [one["bytes"] for one in quote["messages"]] == [len(call[1]) for call in sky.calls]
    assert quote["credits"] == sum(-(-len(call[1]) // 50) for call in sky.calls)
    assert found["credits"] == quote["credits"]
    spent = (await client.get("/api/robots/grace-1/satellite")).json()
    assert spent["credits_today"] == quote["credits"]
    assert spent["credits_left"] == quote["credits_left_today"] - quote["credits"]


async def begun_with_a_budget_for_one_part(station, client):
    plan = await draft(client)
    quote = (await client.get(f"/api/plans/{plan['id']}/satellite")).json()
    credits = quote["messages"][0]["credits"]
    patch = {"tariff": {"credits_per_day": credits}}
    await station.foundation.configurations.patch("satellite", "grace-1", patch, by="test")
    await station.satellite.refresh()
    return await transfer_of(client, plan), credits


async def test_budget_stops_a_plan_until_midnight_or_a_greater_budget(far, sky, robot):
    station, client = far
    path, credits = await begun_with_a_budget_for_one_part(station, client)
    await until(lambda: sky.calls)
    await settled(station)
    waiting = (await client.get(path)).json()
    assert [part["level"] for part in waiting["parts"]] == ["queued", "waiting"]
    assert f"budget of {credits} credits is spent" in waiting["text"]
    await station.satellite.refresh()
    assert station.fleet.status("grace-1").satellite.waits_for_budget
    calls = len(sky.calls)
    await station.commands.send("grace-1", CommandKind.SURFACE, by="test")
    await until(lambda: len(sky.calls) >= calls + 2)
    await settled(station)
    exempt = sky.calls[calls:]
    assert len(exempt) == 2, "the order, and the plan called back"
    assert all(len(call[1]) <= 50 for call in exempt)
    spent = (await client.get("/api/robots/grace-1/satellite")).json()
    assert spent["credits_today"] == credits + len(exempt), "exempt, but counted"
    assert spent["credits_left"] == 0


async def test_budget_of_a_new_day_lets_the_rest_go(far, sky, robot):
    station, client = far
    path, _ = await begun_with_a_budget_for_one_part(station, client)
    await until(lambda: sky.calls)
    await settled(station)
    assert (await client.get(path)).json()["level"] == "created"
    sky.clock.advance(hours=15)
    await settled(station)
    assert (await client.get(path)).json()["level"] == "queued"
