"""Puts the capability together."""

from server.base.foundation import Foundation
from server.current.event import CurrentChanged
from server.fleet.event import RobotReported
from server.fleet.fleet import Fleet
from server.prediction import route
from server.prediction.outlook import Outlook
from server.prediction.predictions import Predictions

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Predict robots that fall silent, and hold predictions against fixes."""
    services, bus = foundation.services, foundation.bus
    fleet = services.get(Fleet)
    predictions = services.add(Predictions(foundation, fleet))
    services.add(Outlook(foundation, fleet, predictions))
    bus.subscribe(RobotReported, predictions.take)
    bus.subscribe(CurrentChanged, predictions.take_current)
    foundation.lifetime.on_start(predictions.start)
    foundation.lifetime.run("predictions", predictions.run)
