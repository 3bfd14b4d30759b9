"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.recording import (
    decision_route,
    export_route,
    foreign_route,
    import_route,
    journal_route,
    other_route,
)
from server.recording.decision_replays import DecisionReplays

ROUTERS = (
    journal_route.router,
    import_route.router,
    foreign_route.router,
    export_route.router,
    decision_route.router,
    other_route.router,
)


def install(foundation: Foundation) -> None:
    """Make what replays decisions; recordings are read when somebody asks."""
    foundation.services.add(DecisionReplays(foundation))
    subjects = foundation.services.get(Subjects)
    subjects.add_self_asking("POST", "/api/imports")
    subjects.add_self_asking("POST", "/api/imports/uploads")
    subjects.add_self_asking("POST", "/api/imports/uploads/{upload}")
    subjects.add_details("upload", "series")
