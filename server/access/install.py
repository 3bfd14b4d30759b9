"""Puts the capability together."""

from robot_link.clock import SystemClock
from server.access import people_route, session_route
from server.access.access import Access
from server.access.failure import SignInFailures
from server.access.guard import Guard
from server.access.presence import Presence
from server.access.stream import SignInWatch, Tickets
from server.access.subject import Subjects
from server.access.throttle import KnownBrowsers
from server.base.foundation import Foundation

ROUTERS = (session_route.router, people_route.router)


def install(foundation: Foundation) -> None:
    """Make who knows the people of a station, and who checks every request."""
    settings, store, clock = foundation.settings, foundation.store, foundation.clock
    failures = SignInFailures(store, clock, foundation.alarms, foundation.background)
    browsers = KnownBrowsers(foundation.secrets.browser_key())
    access = Access(store, clock, SystemClock(), settings.session_hours, failures, browsers)
    foundation.lifetime.on_start(failures.forget)
    foundation.lifetime.run("sign-ins", access.run)
    foundation.services.add(access)
    presence = foundation.services.add(Presence(foundation.bus))
    watch = foundation.services.add(SignInWatch(access, presence))
    foundation.lifetime.run("sign-ins in use", watch.run)
    tickets = foundation.services.add(Tickets(access))
    subjects = foundation.services.add(Subjects(store))
    subjects.add_details("name", "token")
    foundation.services.add(Guard(access, tickets, settings, subjects, presence))
