"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.link.event import DetectionsStored, ReceiverReported
from server.tag import route

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Tell who looks that a robot heard tags, or said how its receiver fares."""
    foundation.services.get(Subjects).add_details("tag")
    feed = foundation.feed

    def heard(stored: DetectionsStored) -> None:
        for robot in {one.robot for one in stored.detections}:
            feed.mark("tags", robot)

    foundation.bus.subscribe(DetectionsStored, heard)
    foundation.bus.subscribe(ReceiverReported, lambda told: feed.mark("tags", told.report.robot))
