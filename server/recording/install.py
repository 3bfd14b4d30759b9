"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.recording import export_route, import_route, journal_route

ROUTERS = (journal_route.router, import_route.router, export_route.router)


def install(foundation: Foundation) -> None:
    """Make nothing: recordings are read from the database when somebody asks."""
    foundation.services.get(Subjects).add_self_asking("POST", "/api/imports")
