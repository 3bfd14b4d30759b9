"""A deployment of three dives, as a robot would tell it."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import httpx
import numpy as np
import pytest

from tests.server.conftest import MINI, OpenStation, until
from tests.server.deployment.shore import answered, deployments, sample_at
from tests.server.fake_link import World, state_report

DIVE_S, REST_S, DIVES, DEEP_M = 240.0, 60.0, 3, 0.6
STEP_S = 5.0
STEP_OF_CHARGE = 0.001


def depth_at(at_s: float) -> float:
    """Return the depth of the flight, m."""
    part = at_s % (DIVE_S + REST_S) - REST_S
    return max(0.0, DEEP_M * (1.0 - abs(part - DIVE_S / 2) / (DIVE_S / 2))) if part > 0 else 0.0


@pytest.fixture
async def flight(client: httpx.AsyncClient, world: World, station: OpenStation) -> str:
    """The path of a deployment with states, temperature and salinity of three dives.

    Temperature falls with depth, salinity is told at other moments, and one value is that of no
    water.
    """
    (now,) = await deployments(client, robot=MINI, state="in_water")
    begin = datetime.now(UTC) - timedelta(hours=1)
    path = f"/api/deployments/{now['id']}"
    await answered(client.patch(path, json={"started_at": begin.isoformat()}))
    moments = np.arange(0.0, DIVES * (DIVE_S + REST_S) + REST_S, STEP_S)
    for number, at_s in enumerate(moments.tolist()):
        at, depth_m = begin + timedelta(seconds=1 + at_s), depth_at(at_s)
        place = (1.0 + 0.001 * at_s, 0.5, depth_m)
        state = state_report(MINI, place, at=at)
        charge = 0.9 - STEP_OF_CHARGE * (at_s // 30)
        world.tell(replace(state, battery_fraction=charge))
        value = 41.0 if number == 100 else 20.0 - 10.0 * depth_m
        for variable, told, late_s in (("temperature", value, 0.0), ("salinity", 35.0, 2.0)):
            sample = sample_at(MINI, at + timedelta(seconds=late_s), number + 1, variable)
            there = (place[0], place[1], depth_at(at_s + late_s))
            log = type(sample.log)(8 + len(variable))
            world.tell(replace(sample, log=log, value=told, position_ned=there))
    station.ingest.flush()

    async def kept():
        return (await deployments(client, robot=MINI))[0]["samples"] == 2 * len(moments)

    await until(kept)
    return path
