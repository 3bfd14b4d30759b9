"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.demo import route
from server.demo.demo import Demo

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Listen to the simulator where the station was told of one."""
    foundation.services.get(Subjects).add_details("fault")
    feed, lifetime = foundation.feed, foundation.lifetime
    demo = foundation.services.add(Demo(foundation.settings.demo_port, lambda: feed.mark("demo")))
    if demo.is_open:
        lifetime.run("demo connection", demo.connect)
        lifetime.run("demo faults", demo.listen)
