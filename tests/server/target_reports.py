"""What tests of robots that follow a target tell the station, and ask it."""

from datetime import UTC, datetime, timedelta
from typing import Any, TypeAlias

import httpx

from autonomy.tracking.phase import TargetPhase
from robot_link.report import TargetReport
from tests.db.target import target_report
from tests.server.conftest import until

Json: TypeAlias = dict[str, Any]
"""What the station answers; a test looks into it and so says what it expects there."""


def now_report(
    age_s: float = 0.0,
    phase: TargetPhase = TargetPhase.TRACKING,
    robot: str = "mini-1",
    **changes: object,
) -> TargetReport:
    at = datetime.now(UTC) - timedelta(seconds=age_s)
    return target_report(0, phase, robot, measured_at=at, received_at=at, **changes)


async def tracking(client: httpx.AsyncClient, **asked: str | float) -> Json:
    answer = await client.get("/api/robots/mini-1/tracking", params=asked)
    assert answer.status_code == 200, answer.text
    return answer.json()


async def events_of(client: httpx.AsyncClient, kind: str) -> list[Json]:
    found = (await client.get("/api/events", params={"limit": 500})).json()
    events = found if isinstance(found, list) else found["events"]
    return [event for event in events if event["kind"] == kind]


async def kept(client: httpx.AsyncClient, count: int) -> Json:
    async def there() -> Json | None:
        found = await tracking(client)
        return found if len(found["reports"]) == count else None

    return await until(there)
