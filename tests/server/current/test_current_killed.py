"""A station that is killed knows the current again: its dives, what was learned, what was said."""

import json
import signal
import subprocess
import sys

import numpy as np
import pytest

from server.current.currents import Currents
from tests.server.conftest import GRACE, open_station

pytestmark = pytest.mark.process

CHILD = """
import asyncio
import json
import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from server.current import currents as module
from server.plan import install as plan
from tests.server.conftest import GRACE, open_station, until
from tests.server.current.test_current import fly
from tests.server.fake_link import World


async def stay_cold(*_):
    pass


async def main():
    world = World()
    async with open_station(Path(sys.argv[1]), world) as station:
        currents = station.foundation.services.get(module.Currents)
        await until(lambda: currents.of(GRACE))
        await fly(station, world, 7)
        found = await until(lambda: currents.of(GRACE).known.learned and currents.of(GRACE))
        at = [200.0, 200.0, 5.0, datetime.now(UTC).timestamp()]
        flow = found.known.flow(np.array([at]))
        told = {
            "at": at,
            "mean": flow.mean_ne_m_s.tolist(),
            "cov": flow.cov_m2_s2.tolist(),
            "learned": found.known.learned.model_dump(mode="json"),
            "errors": [one.error_m for one in found.verdicts],
        }
        print(json.dumps(told), flush=True)
        await asyncio.sleep(600.0)


plan.warm_up = stay_cold
module.GATHER_S = 0.05
asyncio.run(main())
"""


def killed_once_it_learned(folder):
    """Run a station until dives have taught it the current, kill it; return what it knew."""
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(folder)], stdout=subprocess.PIPE, text=True
    )
    try:
        return json.loads(child.stdout.readline())
    finally:
        child.send_signal(signal.SIGKILL)
        child.wait()
        child.stdout.close()


async def test_station_that_was_killed_knows_the_current_again(tmp_path, world):
    told = killed_once_it_learned(tmp_path)
    async with open_station(tmp_path, world) as station:
        again = station.foundation.services.get(Currents).of(GRACE)
        assert len(again.dives) == 7
        assert again.known.learned.model_dump(mode="json") == told["learned"]
        assert not again.is_learning_due
        assert [one.error_m for one in again.verdicts] == pytest.approx(told["errors"])
        flow = again.known.flow(np.array([told["at"]]))
        np.testing.assert_allclose(flow.mean_ne_m_s, told["mean"], atol=1e-12)
        np.testing.assert_allclose(flow.cov_m2_s2, told["cov"], atol=1e-15)
