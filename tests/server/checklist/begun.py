"""A robot whose start waits for its checklist, and hands that tick it."""

from datetime import UTC, datetime

from robot_link.report import Reading
from tests.server.conftest import MINI, until
from tests.server.fake_link import state_report

TANK_LIST = "pre_dive_tank"


def dry(world, robot=MINI, leak=0.0):
    now = datetime.now(UTC)
    world.tell(Reading(robot, "leak", leak, now, now))


async def require(client, robot=MINI, start="required"):
    answer = await client.patch(f"/api/config/checklist?robot={robot}", json={"start": start})
    assert answer.status_code == 200, answer.text


async def lists_of(client, robot=MINI):
    answer = await client.get(f"/api/robots/{robot}/checklists")
    assert answer.status_code == 200, answer.text
    return answer.json()


async def list_of(client, template=TANK_LIST, robot=MINI):
    found = (await lists_of(client, robot))["lists"]
    return {one["template"]: one for one in found}[template]


async def begin(client, template=TANK_LIST, robot=MINI):
    answer = await client.post(f"/api/robots/{robot}/checklists", json={"template": template})
    assert answer.status_code == 201, answer.text
    return await list_of(client, template, robot)


async def tick(client, run, item, ticked=True, note=""):
    body = {"item": item, "ticked": ticked, "note": note}
    return await client.post(f"/api/checklists/{run}/ticks", json=body)


async def tick_all(client, found):
    for item in found["items"]:
        if item["kind"] == "manual" and item["is_blocking"]:
            assert (await tick(client, found["id"], item["key"])).status_code == 201


async def complete(client, run):
    return await client.post(f"/api/checklists/{run}/complete")


async def ready(client, world, robot=MINI):
    """Bring a robot as far as its automatic items can be passed."""
    dry(world, robot)
    world.tell(state_report(robot, (1.2, 0.6, 0.0)))

    async def told():
        found = await list_of(client, robot=robot)
        return all(one["is_done"] for one in found["items"] if one["kind"] == "automatic"
                   and one["is_blocking"])  # fmt: skip

    await until(told)


async def completed(client, world, robot=MINI):
    """Go through the whole list; return it."""
    await ready(client, world, robot)
    found = await begin(client, robot=robot)
    await tick_all(client, found)
    answer = await complete(client, found["id"])
    assert answer.status_code == 200, answer.text
    return await list_of(client, robot=robot)
