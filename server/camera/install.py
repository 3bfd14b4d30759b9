"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.camera import print_route, route, tag_route, trial_route
from server.camera.calibrations import Calibrations
from server.camera.cameras import Cameras
from server.camera.event import CameraChanged, PictureSeen, RigChanged, TagsChanged
from server.camera.picture import keeping_route
from server.camera.picture import route as picture_route
from server.camera.picture.keeping import KeptPictures
from server.camera.picture.newest import Pictures
from server.camera.processes import CameraProcesses
from server.camera.rig import CameraRig
from server.camera.set_up import route as set_up_route
from server.camera.set_up.boards import Boards
from server.camera.set_up.collector import Collector
from server.camera.set_up.jobs import CalibrationJobs
from server.camera.status import CameraStatuses
from server.camera.tags import Tags
from server.camera.trial_route import CameraTrials
from server.camera.watch import CameraWatch

ROUTERS = (
    set_up_route.router,
    trial_route.router,
    route.router,
    picture_route.router,
    keeping_route.router,
    tag_route.router,
    print_route.router,
)


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
    collector = Collector(processes.seek_everywhere)
    jobs = services.add(
        CalibrationJobs(foundation, cameras, tags, rig, calibrations, boards, collector)
    )
    services.add(CameraTrials(foundation))
    kept = services.add(KeptPictures(foundation, cameras, pictures))
    watch = services.add(CameraWatch(foundation, rig, statuses, lambda: processes.config))
    for step in (cameras.load, tags.load, rig.load, calibrations.load, processes.load, jobs.load):
        foundation.lifetime.on_load(step)
    foundation.lifetime.on_start(processes.start)
    foundation.lifetime.on_stop(processes.stop)
    foundation.lifetime.on_start(kept.clean)
    foundation.lifetime.on_stop(kept.stop)
    foundation.lifetime.on_closing(pictures.stop)
    foundation.lifetime.run("watch over cameras", watch.run)
    foundation.lifetime.on_stop(watch.stop)

    def changed(told: CameraChanged) -> None:
        if told.is_removed:
            statuses.drop(told.id)
            boards.drop(told.id)
            pictures.drop(told.id)
            watch.drop(told.id)
        rig.renew()
        processes.changed(told)
        feed.mark("cameras")

    bus.subscribe(CameraChanged, changed)
    bus.subscribe(SettingsChanged, processes.settings_changed)
    bus.subscribe(PictureSeen, collector.take)
    bus.subscribe(PictureSeen, watch.take)
    bus.subscribe(RigChanged, watch.rig_changed)
    bus.subscribe(RigChanged, lambda _: feed.mark("cameras"))
    bus.subscribe(TagsChanged, lambda _: feed.mark("camera_tags"))
