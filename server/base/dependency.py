"""How a route reaches what its station consists of, by the types in its signature.

A dependency is ``async`` even where it awaits nothing: FastAPI runs any other function in a thread,
which costs more than most requests do themselves.
"""

from collections.abc import Awaitable, Callable
from datetime import datetime
from typing import Annotated, TypeVar

from fastapi import Depends, Query
from starlette.requests import HTTPConnection

from db.deployment_span import Period
from db.query.fleet.deployments import DeploymentRecord, NotBegunError, get_deployment
from db.store import Store
from robot_link.clock import Clock
from server.base.foundation import Foundation
from server.base.problem import FieldError, conflict, unprocessable

S = TypeVar("S")


async def get_foundation(connection: HTTPConnection) -> Foundation:
    """Return the foundation of the application that serves this connection."""
    return connection.app.state.foundation


FoundationDep = Annotated[Foundation, Depends(get_foundation)]


async def get_store(foundation: FoundationDep) -> Store:
    """Return the station's memory."""
    return foundation.store


async def get_clock(foundation: FoundationDep) -> Clock:
    """Return the robots' clock."""
    return foundation.clock


StoreDep = Annotated[Store, Depends(get_store)]
ClockDep = Annotated[Clock, Depends(get_clock)]


def service(kind: type[S]) -> Callable[[HTTPConnection], Awaitable[S]]:
    """Return the dependency of a route on one service: ``Annotated[X, Depends(service(X))]``."""

    async def find(connection: HTTPConnection) -> S:
        foundation: Foundation = connection.app.state.foundation
        return foundation.services.get(kind)

    return find


async def _asked(
    store: StoreDep,
    deployment: Annotated[
        str | None, Query(description="Only what belongs to this deployment.")
    ] = None,
) -> DeploymentRecord | None:
    if deployment is None:
        return None
    return await store.query(lambda session: get_deployment(session, deployment))


DeploymentDep = Annotated[DeploymentRecord | None, Depends(_asked)]
"""The deployment that ``?deployment=`` names, ``None`` if it names none."""


def period_of(deployment: DeploymentRecord | None, robot: str | None = None) -> Period | None:
    """Return the time of the deployment that was asked for, ``None`` for all time.

    Raises:
        Problem: 422 if it is one of another robot; 409 if it has not begun.
    """
    if deployment is None:
        return None
    if robot is not None and deployment.robot != robot:
        message = f"{deployment.id} is one of {deployment.robot}"
        raise unprocessable("1 field is wrong.", [FieldError(loc=["deployment"], msg=message)])
    try:
        return deployment.period
    except NotBegunError as error:
        raise conflict(str(error)) from error


def cut_to(
    deployment: DeploymentRecord | None,
    robot: str,
    start: datetime | None,
    end: datetime | None,
) -> tuple[datetime | None, datetime | None]:
    """Return the part between two moments of the deployment that was asked for, if any was.

    Raises:
        Problem: As ``period_of``.
    """
    period = period_of(deployment, robot)
    return (start, end) if period is None else period.cut(start, end)
