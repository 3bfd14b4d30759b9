"""Puts the capability together."""

from server.base.foundation import Foundation
from server.storage import route
from server.storage.sizes import Sizes

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Look at what is kept, now and then."""
    services, lifetime = foundation.services, foundation.lifetime
    sizes = services.add(Sizes(foundation))
    lifetime.on_load(sizes.load)
    lifetime.run("sizes of what is kept", sizes.run)
