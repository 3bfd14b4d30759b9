"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.base_map import route
from server.base_map.base_maps import BaseMaps

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Make what opens the files; they are looked for when somebody asks."""
    foundation.services.get(Subjects).add_details("base_map", "z", "x", "y")
    maps = BaseMaps(foundation.settings.data_dir)
    foundation.services.add(maps)
    foundation.lifetime.on_stop(maps.stop)
