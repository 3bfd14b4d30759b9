"""Puts the capability together."""

import math
from collections.abc import Iterator, Mapping

from prometheus_client.core import Metric
from sqlalchemy.orm import Session

from autonomy.frames import wgs84_from_ned
from db.query.station.notices import queued_notices, waiting_topics
from robot_link.clock import Clock
from server.access.subject import Subjects
from server.base.event_bus import AlarmChanged, EventLogged
from server.base.foundation import Foundation
from server.base.metric.metrics import counted
from server.fleet.fleet import Fleet
from server.notice import assignee_route, link_route, route
from server.notice.heartbeat import Heartbeat
from server.notice.message import Place
from server.notice.outbox import Notices
from server.notice.sender import Sender

ROUTERS = (route.router, assignee_route.router, link_route.router)
_OF_ONESELF = (
    ("GET", "/api/notices"),
    ("GET", "/api/notices/station"),
    ("GET", "/api/notices/people/{person}"),
    ("PUT", "/api/notices/people/{person}"),
    ("POST", "/api/notices/people/{person}/contacts"),
    ("PATCH", "/api/notices/contacts/{contact}"),
    ("DELETE", "/api/notices/contacts/{contact}"),
    ("POST", "/api/notices/contacts/{contact}/test"),
)
"""What whoever pilots any robot may ask, and of themselves alone."""


def install(foundation: Foundation) -> None:
    """Tell people of every alarm, and who watches the station that it is alive."""
    subjects = foundation.services.get(Subjects)
    subjects.add_details("contact", "person", "word")
    for method, path in _OF_ONESELF:
        subjects.add_self_asking(method, path)
    fleet = foundation.services.get(Fleet)
    notices = foundation.services.add(Notices(foundation, lambda: last_places(fleet), Sender()))
    heartbeat = foundation.services.add(Heartbeat(foundation))
    foundation.bus.subscribe(AlarmChanged, notices.alarm_changed)
    foundation.bus.subscribe(EventLogged, notices.event_logged)
    foundation.metrics.add_query(lambda session: _waiting(session, foundation.clock))
    foundation.lifetime.on_load(notices.load)
    foundation.lifetime.on_stop(notices.deliveries.stop)
    foundation.lifetime.run("notices", notices.run)
    foundation.lifetime.run("heartbeat", heartbeat.run)


def _waiting(session: Session, clock: Clock) -> Iterator[Metric]:
    waiting = {
        "unsent": len(queued_notices(session)),
        "to_be_told": len(waiting_topics(session, clock.now())),
    }
    text = "Messages that were not taken yet by a service, and contacts with news on a topic."
    yield counted("notices_waiting", text, "state", waiting)


def last_places(fleet: Fleet) -> Mapping[str, Place]:
    """Return where each robot was when it last said so."""
    places: dict[str, Place] = {}
    for status in fleet.statuses:
        report, site = status.state, status.record.site
        if report is None:
            continue
        latitude_deg, longitude_deg = wgs84_from_ned(
            report.position_ned[:2], site.origin_latitude_deg, site.origin_longitude_deg
        ).tolist()
        std_m = report.position_std_m
        places[status.record.id] = Place(
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            measured_at=report.measured_at,
            has_fix=report.has_fix,
            std_m=std_m if math.isfinite(std_m) else None,
        )
    return places
