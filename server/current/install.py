"""Puts the capability together."""

from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.current import route, told_route
from server.current.currents import Currents
from server.current.event import CurrentChanged
from server.fleet.event import FixTaken, RobotChanged
from server.fleet.fleet import Fleet

ROUTERS = (route.router, told_route.router)


def install(foundation: Foundation) -> None:
    """Map the currents of all waters, and let fixes and settings into them."""
    bus, services = foundation.bus, foundation.services
    currents = services.add(Currents(foundation, services.get(Fleet), foundation.study_workers))
    bus.subscribe(FixTaken, currents.take_fix)
    bus.subscribe(RobotChanged, currents.take_robot)
    bus.subscribe(SettingsChanged, currents.take_settings)
    bus.subscribe(CurrentChanged, lambda event: foundation.feed.mark("current", event.robot))
    foundation.lifetime.on_start(currents.start)
    foundation.lifetime.run("currents", currents.run)
