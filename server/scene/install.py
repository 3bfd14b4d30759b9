"""Puts the capability together."""

from robot_link.messages import RobotId
from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.camera.rig import CameraRig
from server.fix.fusion import Fusion
from server.fleet.fleet import Fleet
from server.map.field_maps import FieldMaps
from server.prediction.predictions import Predictions
from server.scene import replay_route, route
from server.scene.host import SceneHost
from server.scene.replay_host import ReplayScenes
from server.scene.source import StationSceneSource
from server.study.whatif import WhatIfs
from server.vehicle.vehicles import Vehicles
from webui.scene.source import SceneSource

ROUTERS = (route.router, replay_route.router)


def install(foundation: Foundation) -> None:
    """Make what draws robots and maps in three dimensions."""
    services = foundation.services
    services.get(Subjects).add_details("tab")
    fleet, maps = services.get(Fleet), services.get(FieldMaps)
    vehicles, shown = services.get(Vehicles), services.get(WhatIfs).shown
    predictions = services.get(Predictions)
    fusion, rig = services.get(Fusion), services.get(CameraRig)

    def source_of(robot: RobotId) -> SceneSource | None:
        if not fleet.knows(robot):
            return None
        return StationSceneSource(robot, fleet, maps, vehicles, shown, predictions, fusion, rig)

    scenes = services.add(SceneHost(source_of, lambda robot: foundation.feed.mark("view", robot)))
    foundation.lifetime.on_stop(scenes.stop)
    replays = services.add(ReplayScenes(foundation, fleet, vehicles))
    foundation.lifetime.on_stop(replays.stop)
    foundation.lifetime.run("scenes", scenes.run)
