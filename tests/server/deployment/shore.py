"""What the tests about deployments ask of the station."""

from collections.abc import Awaitable
from datetime import datetime
from typing import Any

import httpx

from robot_link.messages import LogId, RobotId, Sample


async def answered(request: Awaitable[httpx.Response], status: int = 200) -> dict[str, Any]:
    """Return what a request is answered with, whose status must be this."""
    answer = await request
    assert answer.status_code == status, answer.text
    return answer.json() if answer.content else {}


async def deployments(client: httpx.AsyncClient, **query: Any) -> list[dict[str, Any]]:
    return (await answered(client.get("/api/deployments", params=query)))["deployments"]


def sample_at(robot: RobotId, at: datetime, sequence: int, variable: str = "blue_light") -> Sample:
    return Sample(
        robot=robot,
        log=LogId(7),
        sequence=sequence,
        variable=variable,
        value=float(sequence),
        position_ned=(1.0, 0.5, 0.2),
        position_std_m=0.03,
        measured_at=at,
        received_at=at,
    )
