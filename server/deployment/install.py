"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.camera.picture.keeping import KeptPictures
from server.deployment import robot_route, route
from server.deployment.deployments import Deployments
from server.deployment.suggestion import Suggestions
from server.fleet.event import RobotReported
from server.fleet.fleet import Fleet
from server.fleet.roster import Roster

ROUTERS = (robot_route.router, route.router)


def install(foundation: Foundation) -> None:
    """Make what changes deployments, and what suggests it."""
    services = foundation.services
    subjects = services.get(Subjects)
    subjects.add_stored("deployment")
    subjects.add_self_asking("POST", "/api/deployments")
    services.add(Deployments(foundation, services.get(Roster), services.get(KeptPictures)))
    suggestions = services.add(
        Suggestions(foundation.store, services.get(Fleet), foundation.background)
    )
    foundation.bus.subscribe(RobotReported, suggestions.look)
