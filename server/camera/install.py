"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.camera import picture_route, route, tag_route
from server.camera.boards import Boards
from server.camera.calibrations import Calibrations
from server.camera.cameras import Cameras
from server.camera.event import CameraChanged, RigChanged, TagsChanged
from server.camera.pictures import Pictures
from server.camera.processes import CameraProcesses
from server.camera.rig import CameraRig
from server.camera.status import CameraStatuses
from server.camera.tags import Tags

ROUTERS = (route.router, picture_route.router, tag_route.router)


def install(foundation: Foundation) -> None:
    """Make the cameras, and tell the live stream when they change."""
    services, bus, feed = foundation.services, foundation.bus, foundation.feed
    services.get(Subjects).add_details("camera", "calibration")
    cameras = services.add(Cameras(foundation))
    tags = services.add(Tags(foundation))
    rig = services.add(CameraRig(foundation, cameras, tags))
    calibrations = services.add(Calibrations(foundation, cameras, rig))
    statuses = services.add(CameraStatuses(lambda: feed.mark("cameras")))
    boards, pictures = services.add(Boards(foundation)), services.add(Pictures(statuses))
    processes = services.add(
        CameraProcesses(foundation, cameras, statuses, rig, calibrations, boards, pictures)
    )
    rig.on_regions(processes.set_regions)
    boards.on_ask(processes.ask_board)
    pictures.on_want(processes.want_previews)
    for step in (cameras.load, tags.load, rig.load, calibrations.load, processes.load):
        foundation.lifetime.on_load(step)
    foundation.lifetime.on_start(processes.start)
    foundation.lifetime.on_stop(processes.stop)
    foundation.lifetime.on_closing(pictures.stop)

    def changed(told: CameraChanged) -> None:
        if told.is_removed:
            statuses.drop(told.id)
            boards.drop(told.id)
            pictures.drop(told.id)
            rig.renew()
        processes.changed(told)
        feed.mark("cameras")

    bus.subscribe(CameraChanged, changed)
    bus.subscribe(SettingsChanged, processes.settings_changed)
    bus.subscribe(RigChanged, lambda _: feed.mark("cameras"))
    bus.subscribe(TagsChanged, lambda _: feed.mark("camera_tags"))
