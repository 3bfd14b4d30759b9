"""A station in a process of its own that is killed between the rows and the bytes.

    python -m tests.server.schedule.doomed_station DATA_DIR

It has a plan sent at a surfacing by itself, and kills itself with SIGKILL when the row says that it
is sent and the radio has taken nothing yet. On its output it names the plan and the scheduled send.
"""

import asyncio
import os
import signal
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

from robot_link.messages import RobotMode
from server.access.role import Role
from tests.server.conftest import MINI, api_client, open_station, until
from tests.server.fake_link import World, current_report, state_report
from tests.server.transfer.test_upload import DIVE, plan_in


async def main(folder: Path) -> None:
    """Live until the row is there."""
    world = World()
    world.radio_takes = False
    world.may_upload.clear()
    async with open_station(folder, world) as station, api_client(station, Role.ADMIN) as client:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        plan = (await client.post(f"/api/robots/{MINI}/plans", json=DIVE)).json()["id"]
        await plan_in(client, plan, "draft")
        expires_at = datetime.now(UTC) + timedelta(minutes=5)
        wish = {"condition": {"kind": "surfacing"}, "expires_at": expires_at.isoformat()}
        send = (await client.post(f"/api/plans/{plan}/schedule", json=wish)).json()["id"]
        sys.stdout.write(f"{plan} {send}\n")
        sys.stdout.flush()
        world.tell(state_report(MINI, (1.2, 0.6, 0.6), mode=RobotMode.GLIDING))
        world.tell(state_report(MINI, (1.2, 0.6, 0.0), mode=RobotMode.SURFACED))
        await until(lambda: world.uploads)
        os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1])))
