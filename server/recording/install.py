"""Puts the capability together."""

from server.base.foundation import Foundation
from server.recording import export_route, import_route, journal_route

ROUTERS = (journal_route.router, import_route.router, export_route.router)


def install(foundation: Foundation) -> None:
    """Make nothing: recordings are read from the database when somebody asks."""
    del foundation
