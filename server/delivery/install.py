"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.delivery import quality_route
from server.delivery.quality import QualityRuns

ROUTERS = (quality_route.router,)


def install(foundation: Foundation) -> None:
    """Make what judges deployments."""
    foundation.services.get(Subjects).add_details("flag")
    foundation.services.add(QualityRuns(foundation))
