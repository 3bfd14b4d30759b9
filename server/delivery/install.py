"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.delivery import file_route, quality_route
from server.delivery.files import DeliveryFiles
from server.delivery.quality import QualityRuns

ROUTERS = (quality_route.router, file_route.router)


def install(foundation: Foundation) -> None:
    """Make what judges deployments and writes files of them."""
    foundation.services.get(Subjects).add_details("flag", "file")
    foundation.services.add(QualityRuns(foundation))
    foundation.services.add(DeliveryFiles(foundation))
