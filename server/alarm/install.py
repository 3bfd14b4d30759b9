"""Puts the capability together."""

from server.alarm import route
from server.alarm.rules import watch_fleet
from server.base.foundation import Foundation
from server.fleet.fleet import Fleet

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Let every rule look at every robot."""
    fleet = foundation.services.get(Fleet)
    foundation.lifetime.run(
        "alarm rules", lambda: watch_fleet(fleet, foundation.alarms, foundation.clock)
    )
