"""Puts the capability together."""

from server.base.foundation import Foundation
from server.fleet.fleet import Fleet
from server.replay import route
from server.replay.replays import Replays

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Make what answers replays."""
    services = foundation.services
    services.add(Replays(foundation, services.get(Fleet)))
