"""How a route reaches what its station consists of, by the types in its signature."""

from collections.abc import Callable
from typing import Annotated, TypeVar

from fastapi import Depends
from starlette.requests import HTTPConnection

from db.store import Store
from robot_link.clock import Clock
from server.base.foundation import Foundation

S = TypeVar("S")


def get_foundation(connection: HTTPConnection) -> Foundation:
    """Return the foundation of the application that serves this connection."""
    return connection.app.state.foundation


FoundationDep = Annotated[Foundation, Depends(get_foundation)]


def get_store(foundation: FoundationDep) -> Store:
    """Return the station's memory."""
    return foundation.store


def get_clock(foundation: FoundationDep) -> Clock:
    """Return the robots' clock."""
    return foundation.clock


StoreDep = Annotated[Store, Depends(get_store)]
ClockDep = Annotated[Clock, Depends(get_clock)]


def service(kind: type[S]) -> Callable[[HTTPConnection], S]:
    """Return the dependency of a route on one service: ``Annotated[X, Depends(service(X))]``."""

    def find(connection: HTTPConnection) -> S:
        return get_foundation(connection).services.get(kind)

    return find
