"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.camera import route, tag_route
from server.camera.calibrations import Calibrations
from server.camera.cameras import Cameras
from server.camera.event import CameraChanged, RigChanged, TagsChanged
from server.camera.rig import CameraRig
from server.camera.status import CameraStatuses
from server.camera.tags import Tags

ROUTERS = (route.router, tag_route.router)


def install(foundation: Foundation) -> None:
    """Make the cameras, and tell the live stream when they change."""
    services, bus, feed = foundation.services, foundation.bus, foundation.feed
    services.get(Subjects).add_details("camera", "calibration")
    cameras = services.add(Cameras(foundation))
    tags = services.add(Tags(foundation))
    rig = services.add(CameraRig(foundation, cameras, tags))
    calibrations = services.add(Calibrations(foundation, cameras, rig))
    statuses = services.add(CameraStatuses(lambda: feed.mark("cameras")))
    for step in (cameras.load, tags.load, rig.load, calibrations.load):
        foundation.lifetime.on_load(step)

    def changed(told: CameraChanged) -> None:
        if told.is_removed:
            statuses.drop(told.id)
            rig.renew()
        feed.mark("cameras")

    bus.subscribe(CameraChanged, changed)
    bus.subscribe(RigChanged, lambda _: feed.mark("cameras"))
    bus.subscribe(TagsChanged, lambda _: feed.mark("camera_tags"))
