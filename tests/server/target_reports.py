"""What tests of robots that follow a target tell the station, and ask it."""

from datetime import UTC, datetime, timedelta

from autonomy.tracking.phase import TargetPhase
from tests.db.target import target_report
from tests.server.conftest import until


def now_report(age_s=0.0, phase=TargetPhase.TRACKING, **changes):
    at = datetime.now(UTC) - timedelta(seconds=age_s)
    return target_report(0, phase, measured_at=at, received_at=at, **changes)


async def tracking(client, **asked):
    answer = await client.get("/api/robots/mini-1/tracking", params=asked)
    assert answer.status_code == 200, answer.text
    return answer.json()


async def events_of(client, kind):
    found = (await client.get("/api/events", params={"limit": 500})).json()
    events = found if isinstance(found, list) else found["events"]
    return [event for event in events if event["kind"] == kind]


async def kept(client, count):
    async def there():
        found = await tracking(client)
        return found if len(found["reports"]) == count else None

    return await until(there)
