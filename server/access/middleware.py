"""What holds for every request, whichever route takes it."""

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.access.body import BodyReader
from server.access.guard import Guard
from server.base.problem import problem_response

_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "X-Frame-Options": "SAMEORIGIN",
}


_TLS_ONLY = "max-age=31536000"


class RequestGuard:
    """Refuses foreign host names and unsound bodies, and tells browsers to be careful."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._bodies = BodyReader()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection; WebSockets are checked by their own routes."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        guard = request.app.state.foundation.services.get(Guard)

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
                if guard.speaks_tls:
                    headers.setdefault("Strict-Transport-Security", _TLS_ONLY)
                if request.url.path.startswith("/api/"):
                    headers.setdefault("Cache-Control", "no-store")
            await send(message)

        if guard.host_is_ours(request):
            with self._bodies.guard(request, receive, guard) as body:
                await self._app(scope, body.receive, send_guarded)
        else:
            refusal = problem_response(421, f"This station is not {request.url.hostname}.")
            await refusal(scope, receive, send_guarded)
