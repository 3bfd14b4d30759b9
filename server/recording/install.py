"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.recording import export_route, foreign_route, import_route, journal_route

ROUTERS = (
    journal_route.router,
    import_route.router,
    foreign_route.router,
    export_route.router,
)


def install(foundation: Foundation) -> None:
    """Make nothing: recordings are read from the database when somebody asks."""
    subjects = foundation.services.get(Subjects)
    subjects.add_self_asking("POST", "/api/imports")
    subjects.add_self_asking("POST", "/api/imports/uploads")
    subjects.add_self_asking("POST", "/api/imports/uploads/{upload}")
    subjects.add_details("upload")
