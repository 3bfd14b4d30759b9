"""Puts the capability together."""

from db.query.log_book.told import GROUP_OF
from server.access.subject import Subjects
from server.base.event_bus import EventLogged
from server.base.foundation import Foundation
from server.logbook import report_route, route, watch_route
from server.logbook.log_book import LogBook
from server.logbook.watch import Watch

ROUTERS = (
    route.router,
    route.picture_router,
    watch_route.router,
    report_route.router,
)
_OWN = ("log.", "shift.", "page.")


def install(foundation: Foundation) -> None:
    """Make the log book and its watches, and tell whoever reads it when it has something new."""
    subjects = foundation.services.get(Subjects)
    subjects.add_whole(*(f"/api/logbook/{part}" for part in ("shifts", "handover", "pages")))
    subjects.add_details("entry", "page", "sha256")
    for method, path in route.ASK_THEMSELVES:
        subjects.add_self_asking(method, path)
    log_book = foundation.services.add(LogBook(foundation))
    foundation.lifetime.run("unused pictures", log_book.clean)
    foundation.services.add(Watch(foundation))

    def told(logged: EventLogged) -> None:
        kind = logged.event.kind
        if kind.startswith(_OWN) or kind in GROUP_OF:
            foundation.feed.mark("logbook")

    foundation.bus.subscribe(EventLogged, told)
