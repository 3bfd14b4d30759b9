"""Puts the capability together."""

from collections.abc import Callable
from datetime import datetime

from server.backup import route
from server.backup.backups import Backups, wall
from server.base.event_bus import JobChanged
from server.base.foundation import Foundation

ROUTERS = (route.router,)


def install(foundation: Foundation, now: Callable[[], datetime] = wall) -> None:
    """Make what backs the station up; ``now`` is the time of the wall, UTC."""
    backups = foundation.services.add(Backups(foundation, now))
    foundation.bus.subscribe(JobChanged, backups.take_job)
    foundation.lifetime.on_load(backups.load)
    foundation.lifetime.run("backups", backups.run)
