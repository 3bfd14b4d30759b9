"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.fleet.fleet import Fleet
from server.replay import route
from server.replay.film import route as film_route
from server.replay.film.films import Films
from server.replay.replays import Replays
from server.vehicle.vehicles import Vehicles

ROUTERS = (route.router, film_route.router)


def install(foundation: Foundation) -> None:
    """Make what answers replays, and what makes films of them."""
    services = foundation.services
    services.get(Subjects).add_details("film")
    services.add(Replays(foundation, services.get(Fleet)))
    films = services.add(Films(foundation, services.get(Fleet), services.get(Vehicles)))
    foundation.lifetime.on_load(films.load)
    foundation.lifetime.run("expired films", films.clean)
