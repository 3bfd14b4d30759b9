"""A station that is killed between two edits has every edit that it acknowledged."""

import signal
import subprocess
import sys

import numpy as np
import pytest

from autonomy.design.document import Design
from server.design.designs import Designs
from tests.server.conftest import MINI, open_station

pytestmark = pytest.mark.process

CHILD = """
import asyncio
import sys
from pathlib import Path

from autonomy.design.document import Design, Way, Waypoint
from server.design.designs import Designs
from server.design.view import NewDesign
from server.plan import install as plan
from tests.server.conftest import MINI, open_station
from tests.server.fake_link import World


async def stay_cold(*_):
    pass


def at(number):
    return Design(content=Way(waypoints=(Waypoint(north_m=number, east_m=0.0),)))


async def main():
    async with open_station(Path(sys.argv[1]), World()) as station:
        designs = station.foundation.services.get(Designs)
        design = await designs.add(MINI, NewDesign(name="Line", document=at(0)), by="ann")
        for number in range(1, 100_000):
            design = await designs.change(
                design.id, at(number), f"Moved {number}", revision=design.revision, by="ann"
            )
            print(design.id, number, flush=True)


plan.warm_up = stay_cold
asyncio.run(main())
"""


def killed_after(folder, edits):
    """Edit in a station until so many edits were acknowledged, kill it; return the last one."""
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(folder)], stdout=subprocess.PIPE, text=True
    )
    try:
        for _ in range(edits):
            design, number = child.stdout.readline().split()
    finally:
        child.send_signal(signal.SIGKILL)
        rest = child.stdout.read().splitlines()
        child.wait()
        child.stdout.close()
    acknowledged = [line.split()[1] for line in rest if len(line.split()) == 2]
    return design, max(int(number), *map(int, acknowledged), 0)


async def test_acknowledged_edits_outlive_a_kill(tmp_path, world):
    edits = int(np.random.default_rng().integers(1, 120))
    sys.stdout.write(f"killed after {edits} edits\n")
    design, last = killed_after(tmp_path, edits)
    async with open_station(tmp_path, world) as station:
        designs = station.foundation.services.get(Designs)
        kept = await designs.get(design)
        number = Design.model_validate(kept.document).content.waypoints[0].north_m
        assert number in {last, last + 1}
        assert kept.what == f"Moved {number:g}"
        undone = await designs.move(design, -1, revision=kept.revision, by="ann")
        back = Design.model_validate(undone.document).content.waypoints[0].north_m
        assert back == number - 1
        assert (await designs.of_robot(MINI))[0].id == design
