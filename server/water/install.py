"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.water import import_route, route
from server.water.event import WaterChanged
from server.water.waters import Waters

ROUTERS = (import_route.router, route.router)


def install(foundation: Foundation) -> None:
    """Make the waters, and tell the live stream when they change."""
    foundation.services.get(Subjects).add_details("water")
    foundation.services.add(Waters(foundation))
    foundation.bus.subscribe(WaterChanged, lambda _: foundation.feed.mark("waters"))
