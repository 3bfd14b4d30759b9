"""A plan in the making goes on after the station ended in the middle of it, but not for ever."""

from dataclasses import replace

from db.fault import StoreUnavailableError
from server.plan.document import legs_of
from server.plan.planning import INTERRUPTIONS, TAKEN_UP_MAX
from server.plan.search.request import SearchRequest, request_of_plan
from tests.server.conftest import FAST, MINI, open_station, until
from tests.server.fake_link import current_report, state_report


async def begun(station, world, **changes):
    """Return a plan that is being searched for, and what was asked for."""
    world.hear(MINI)
    world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
    world.tell(current_report(MINI))
    config_id, config = await station.planning.configure(MINI, FAST, by="ann")
    request = replace(SearchRequest(MINI, config, config_id, "ann"), **changes)
    return await station.planning.plan_survey(request), request


async def ended(station, plan):
    async def is_over():
        return (await station.plans.get(plan)).state != "planning"

    await until(is_over)
    return await station.plans.get(plan)


async def test_a_search_is_begun_again_as_it_was_asked_for(tmp_path, world, workers):
    async with open_station(tmp_path, world) as station:
        first, _ = await begun(station, world)
        warm = (legs_of((await ended(station, first.id)).document),)
        workers.may_plan.clear()
        asked = {"start_xy": (1.1, 0.5), "warm": warm, "budget": 7.5, "attempt": 2}
        plan, _ = await begun(station, world, **asked)
        await until(lambda: len(workers.problems) == 2)
    async with open_station(tmp_path, world) as station:
        await until(lambda: len(workers.problems) == 3)
        found = await station.plans.get(plan.id)
        assert found.document["message"].startswith("Taken up again after the station restarted at")
        kept = request_of_plan(found)
        assert {name: getattr(kept, name) for name in asked} == asked
        assert kept.by == "ann"
        before, again = workers.problems[1:]
        assert (again.start_xy, again.warm) == (before.start_xy, before.warm)
        workers.may_plan.set()
        assert (await ended(station, plan.id)).state == "draft"


async def test_a_search_that_storage_let_down_is_begun_again_once_it_works(
    tmp_path, world, workers, monkeypatch
):
    async with open_station(tmp_path, world) as station:
        survey, faults = station.planning.problems.survey, [StoreUnavailableError("It is gone.")]

        async def failing_once(*asked, **more):
            if faults:
                raise faults.pop()
            return await survey(*asked, **more)

        monkeypatch.setattr(station.planning.problems, "survey", failing_once)
        plan, _ = await begun(station, world)
        found = await ended(station, plan.id)
        assert found.state == "draft"
        assert found.document[INTERRUPTIONS] == 1
        assert not faults
        assert len(workers.problems) == 1


async def test_a_search_that_storage_lets_down_again_and_again_is_given_up(
    tmp_path, world, workers, monkeypatch
):
    async with open_station(tmp_path, world) as station:

        async def failing(*_, **__):
            raise StoreUnavailableError("It is gone.")

        monkeypatch.setattr(station.planning.problems, "survey", failing)
        plan, _ = await begun(station, world)
        found = await ended(station, plan.id)
        assert found.document["message"] == "Its making was interrupted 3 times; plan again."
        assert workers.problems == []


async def test_a_plan_that_the_station_ends_in_again_and_again_is_given_up(
    tmp_path, world, workers
):
    workers.may_plan.clear()
    async with open_station(tmp_path, world) as station:
        plan, _ = await begun(station, world)
        await until(lambda: workers.problems)
    for times in range(TAKEN_UP_MAX):
        async with open_station(tmp_path, world):
            await until(lambda times=times: len(workers.problems) == times + 2)
    async with open_station(tmp_path, world) as station:
        given_up = await station.plans.get(plan.id)
        assert given_up.state == "failed"
        assert given_up.document["message"] == "Its making was interrupted 3 times; plan again."
    assert len(workers.problems) == TAKEN_UP_MAX + 1
