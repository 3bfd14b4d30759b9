"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.watch import figures, metrics_route
from server.watch.loop import LoopWatch
from server.watch.memory import trim_regularly
from server.watch.request import RequestMetrics
from server.watch.station_clock import StationClock

ROUTERS = (metrics_route.router,)


def install(foundation: Foundation) -> None:
    """Watch the station itself."""
    foundation.services.get(Subjects).add_whole("/metrics")
    figures.register(foundation)
    loop = foundation.services.add(LoopWatch(foundation.metrics))
    foundation.services.add(RequestMetrics(foundation.metrics))
    foundation.lifetime.run("event loop watch", loop.run)
    foundation.lifetime.run("free memory", trim_regularly)
    clock = foundation.services.add(StationClock(foundation))
    foundation.lifetime.run("clock watch", clock.run)
