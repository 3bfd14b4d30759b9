"""A deployment with measurements, as the tests of what leaves the station judge and write it."""

from datetime import UTC, datetime, timedelta

import httpx
import pytest

from tests.server.conftest import MINI, OpenStation, until
from tests.server.deployment.shore import answered, deployments, sample_at
from tests.server.fake_link import World, state_report

MINUTES = (50, 40, 30, 20, 10)


@pytest.fixture
async def deployment(client: httpx.AsyncClient, world: World, station: OpenStation) -> str:
    """A deployment with five values of temperature, one of which no water has."""
    (now,) = await deployments(client, robot=MINI, state="in_water")
    begin = datetime.now(UTC) - timedelta(hours=1)
    path = f"/api/deployments/{now['id']}"
    await answered(client.patch(path, json={"started_at": begin.isoformat()}))
    for minutes in MINUTES:
        at = datetime.now(UTC) - timedelta(minutes=minutes)
        world.tell(state_report(MINI, (1.0, 0.5, 0.2), at=at))
        value = 41 if minutes == 30 else minutes // 2
        world.tell(sample_at(MINI, at, value, "temperature"))
    station.ingest.flush()

    async def kept():
        return (await deployments(client, robot=MINI))[0]["samples"] == len(MINUTES)

    await until(kept)
    return path
