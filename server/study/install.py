"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.current.currents import Currents
from server.fleet.fleet import Fleet
from server.study import identification_route, trim_route, whatif_route
from server.study.identification import Identifications
from server.study.trim import TrimAdvices
from server.study.whatif import WhatIfs
from server.vehicle.vehicles import Vehicles

ROUTERS = (whatif_route.router, identification_route.router, trim_route.router)


def install(foundation: Foundation) -> None:
    """Make what tries controllers, identifies vehicles and advises on trim."""
    subjects = foundation.services.get(Subjects)
    subjects.add_stored("whatif")
    subjects.add_stored("identification")
    services, lifetime = foundation.services, foundation.lifetime
    fleet, vehicles = services.get(Fleet), services.get(Vehicles)
    workers = foundation.study_workers
    whatifs = services.add(WhatIfs(foundation, fleet, vehicles, services.get(Currents), workers))
    found = services.add(Identifications(foundation, fleet, vehicles, workers))
    services.add(TrimAdvices(foundation, fleet, vehicles, workers))
    lifetime.on_load(whatifs.load)
    lifetime.on_load(found.load)
    lifetime.on_stop(found.stop)
    lifetime.on_stop(whatifs.stop)
