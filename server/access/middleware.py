"""What holds for every request, whichever route takes it."""

from starlette.datastructures import MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.access.guard import Guard
from server.base.problem import problem_response

_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "X-Frame-Options": "SAMEORIGIN",
}


IMPORT_PATH = "/api/imports"
IMPORT_BYTES_MAX = 512 * 2**20
BODY_BYTES_MAX = 8 * 2**20


class RequestGuard:
    """Refuses foreign host names and endless bodies, and tells browsers to be careful."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection; WebSockets are checked by their own routes."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
                if request.url.path.startswith("/api/"):
                    headers.setdefault("Cache-Control", "no-store")
            await send(message)

        if request.app.state.foundation.services.get(Guard).host_is_ours(request):
            await self._app(scope, _limited(request, receive), send_guarded)
        else:
            refusal = problem_response(421, f"This station is not {request.url.hostname}.")
            await refusal(scope, receive, send_guarded)


def _limited(request: Request, receive: Receive) -> Receive:
    """Count the bytes of a body as they come in, whatever the client says of its length."""
    limit = IMPORT_BYTES_MAX if request.url.path == IMPORT_PATH else BODY_BYTES_MAX
    taken = 0

    async def receive_counted() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        if taken > limit:
            raise HTTPException(413, f"This is longer than the {limit // 2**20} MB that are taken.")
        return message

    return receive_counted
