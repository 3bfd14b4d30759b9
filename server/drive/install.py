"""Puts the capability together."""

from server.base.foundation import Foundation
from server.command.state import SurfaceOrdered
from server.drive import route
from server.drive.drives import Drives
from server.fleet.fleet import Fleet
from server.lease.hold import HoldChanged
from server.lease.state import LeaseChanged
from server.link.radios import Radios

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Make what lets people drive; an order to surface ends it, and another in charge."""
    services = foundation.services
    drives = services.add(Drives(foundation, services.get(Fleet), services.get(Radios)))
    foundation.bus.subscribe(LeaseChanged, drives.take_lease)
    foundation.bus.subscribe(HoldChanged, drives.take_hold)
    foundation.bus.subscribe(
        SurfaceOrdered, lambda event: drives.stop(event.robot, "It was told to surface.")
    )
