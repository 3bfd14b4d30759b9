"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.design import file_route, route, template_route
from server.design.designs import Designs
from server.design.sides import Sides
from server.fleet.fleet import Fleet
from server.plan.planning import Planning

ROUTERS = (template_route.router, file_route.router, route.router)


def install(foundation: Foundation) -> None:
    """Make what keeps designs and what compares them."""
    subjects = foundation.services.get(Subjects)
    subjects.add_stored("design")
    subjects.add_details("number", "template")
    services = foundation.services
    fleet = services.get(Fleet)
    designs = services.add(Designs(foundation, fleet, services.get(Planning)))
    services.add(Sides(foundation, fleet, designs))
