"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.vehicle import coefficients_route, route
from server.vehicle.vehicles import Vehicles

ROUTERS = (route.router, coefficients_route.router)


def install(foundation: Foundation) -> None:
    """Make the catalogue of vehicles."""
    foundation.services.get(Subjects).add_details("key")
    vehicles = Vehicles(foundation.store, foundation.clock, foundation.workers)
    foundation.services.add(vehicles)
    foundation.lifetime.on_load(vehicles.load)
    foundation.lifetime.on_stop(vehicles.stop)
