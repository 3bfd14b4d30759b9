"""Puts the capability together."""

from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.storage import route
from server.storage.passes import Passes
from server.storage.sizes import Sizes

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Look at what is kept now and then, and see to it daily."""
    services, lifetime = foundation.services, foundation.lifetime
    sizes = services.add(Sizes(foundation))
    passes = services.add(Passes(foundation, sizes))
    lifetime.on_load(sizes.load)
    lifetime.on_load(passes.load)
    lifetime.run("sizes of what is kept", sizes.run)
    lifetime.run("passes over what is kept", passes.run)
    foundation.bus.subscribe(SettingsChanged, passes.settings_changed)
