"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.delivery import file_route, quality_route
from server.delivery.files import DeliveryFiles, Writing
from server.delivery.package import route as package_route
from server.delivery.package.packages import JOB, DeliveryPackages
from server.delivery.quality import QualityRuns

ROUTERS = (quality_route.router, file_route.router, package_route.router)


def install(foundation: Foundation) -> None:
    """Make what judges deployments, writes files of them and packs deliveries."""
    foundation.services.get(Subjects).add_details("flag", "file", "package")
    foundation.services.add(QualityRuns(foundation))
    writing = Writing(foundation, JOB)
    foundation.services.add(DeliveryFiles(foundation, writing))
    packages = foundation.services.add(DeliveryPackages(foundation, writing))
    foundation.lifetime.on_load(packages.load)
    foundation.lifetime.run("expired deliveries", packages.clean)
