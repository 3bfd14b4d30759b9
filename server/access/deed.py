"""No change without a trace: what a request changed that no event tells of gets one of its own.

Most of what people do leaves events that say more, in the transaction of the change. This is the
net beneath them: a change by a route that tells of nothing is in the log all the same.
"""

import logging
from http import HTTPStatus

from starlette.requests import Request

from db.actor import acting
from db.fault import StoreError
from db.query.station.events import add_event
from server.access.guard import SAFE_METHODS
from server.base.foundation import Foundation

log = logging.getLogger(__name__)

TOLD_ELSEWHERE = frozenset(
    {
        ("POST", "/api/session/ticket"),
        ("POST", "/api/plans/{plan}/check"),
        ("POST", "/api/robots/{robot}/designs/check"),
        ("POST", "/api/robots/{robot}/designs/read"),
        ("POST", "/api/robots/{robot}/parameters/compare"),
        ("POST", "/api/designs/{design}/difference"),
        ("PUT", "/api/designs/{design}/document"),
        ("POST", "/api/designs/{design}/undo"),
        ("POST", "/api/designs/{design}/redo"),
        ("POST", "/api/designs/{design}/restore"),
    }
)
"""Routes that change nothing, and those of designs, which keep every step with its author."""


async def note_deed(request: Request, status: int, *, is_repeated: bool) -> None:
    """Leave an event of a request that succeeded, if there is none yet; before it is answered.

    Args:
        request: After its route was done.
        status: Of its answer.
        is_repeated: Whether that is the answer of an earlier request, so that nothing was done.
    """
    actor = acting.get()
    if actor is None or actor.events or request.method in SAFE_METHODS or is_repeated:
        return
    path = getattr(request.scope.get("route"), "path", None)
    if path is None or status >= HTTPStatus.BAD_REQUEST or (request.method, path) in TOLD_ELSEWHERE:
        return
    foundation: Foundation = request.app.state.foundation
    at, data = foundation.clock.now(), {"method": request.method, "path": request.url.path}
    text = f"{actor.name} asked for {request.method} {request.url.path}."
    try:
        await foundation.store.write(
            lambda session: add_event(session, at, "request.done", text, data=data)
        )
    except StoreError as error:
        log.warning("a change by %s is not in the log: %s", actor.name, error)
