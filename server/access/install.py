"""Puts the capability together."""

from robot_link.clock import SystemClock
from server.access import people_route, session_route
from server.access.access import Access
from server.access.guard import Guard
from server.access.stream import Tickets
from server.base.foundation import Foundation

ROUTERS = (session_route.router, people_route.router)


def install(foundation: Foundation) -> None:
    """Make who knows the people of a station, and who checks every request."""
    settings = foundation.settings
    access = Access(foundation.store, foundation.clock, SystemClock(), settings.session_hours)
    foundation.services.add(access)
    tickets = foundation.services.add(Tickets(access))
    foundation.services.add(Guard(access, tickets, settings))
