"""Puts the capability together."""

from robot_link.clock import SystemClock
from server.access import group_route, people_route, session_route, sign_in_route
from server.access.access import Access
from server.access.failure import SignInFailures
from server.access.guard import Guard
from server.access.idempotency import OpenKeys
from server.access.oidc import route as oidc_route
from server.access.oidc.desk import SignInDesk
from server.access.presence import Presence
from server.access.rate import TokenLimits
from server.access.stream import SignInWatch, Tickets
from server.access.subject import Subjects
from server.access.throttle import KnownBrowsers
from server.base.foundation import Foundation

ROUTERS = (
    oidc_route.router,
    session_route.router,
    sign_in_route.router,
    people_route.router,
    group_route.router,
)


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
    foundation.services.add(SignInDesk(settings))
    foundation.services.add(OpenKeys())
    subjects = foundation.services.add(Subjects(store))
    subjects.add_details("name", "token", "group", "session", "link")
    limits = foundation.services.add(TokenLimits(settings, foundation.jobs))
    foundation.services.add(Guard(access, tickets, settings, subjects, presence, limits))
