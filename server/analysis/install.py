"""Puts the capability together."""

from server.analysis import route
from server.analysis.analyses import Analyses
from server.base.foundation import Foundation

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Make what reads deployments for figures."""
    foundation.services.add(Analyses(foundation))
