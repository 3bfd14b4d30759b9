"""What each request took, and by which id its lines in the log are found."""

import logging
import re
import secrets
import time
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.base.metric.metrics import Metrics
from server.base.problem import REQUEST_ID, REQUEST_ID_HEADER

REQUEST_LOGGER: Final = "grace.request"
log = logging.getLogger(REQUEST_LOGGER)
LATENCY_BUCKETS_S: Final = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
_QUIET: Final = frozenset({"/metrics", "/api/health"})
"""Routes that machines ask all the time: their lines say nothing, unless they fail."""
_METHODS: Final = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
_OTHER_METHOD: Final = "other"
"""Stands for a method that somebody made up: each value of a label is a series for ever."""
_FOREIGN_ID: Final = re.compile(r"[A-Za-z0-9._-]{8,64}")
_FAILED: Final = 500


@dataclass(slots=True)
class Asked:
    """A request while it is served, for what is logged meanwhile."""

    id: str
    scope: Scope

    @property
    def robot(self) -> str | None:
        """The robot that its path names."""
        return self.scope.get("path_params", {}).get("robot")

    @property
    def person(self) -> str | None:
        """Who asks, once that is proved."""
        caller = self.scope.get("state", {}).get("caller")
        return None if caller is None else caller.name


asked: ContextVar[Asked | None] = ContextVar("asked", default=None)
"""The request that is being served."""


class RequestMetrics:
    """Counts requests by route, method and status, and how long each route takes."""

    def __init__(self, metrics: Metrics) -> None:
        self._requests = metrics.counter(
            "http_requests", "Requests that were answered.", ("route", "method", "status")
        )
        self._latency = metrics.histogram(
            "http_request_duration_seconds",
            "From a request to the end of its answer.",
            LATENCY_BUCKETS_S,
            ("route",),
        )

    def note(self, route: str, method: str, status: int, took_s: float) -> None:
        """Count a request that was answered."""
        known = method if method in _METHODS else _OTHER_METHOD
        self._requests.labels(route, known, str(status)).inc()
        self._latency.labels(route).observe(took_s)


class RequestWatch:
    """Gives each request an id, counts it and logs it; the outermost of the middlewares.

    The id comes back as ``X-Request-ID``. One that a proxy has given already is kept if it is
    plain. Only the template of a route is told, never an address: those may hold secrets.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        request = Asked(_id_of(Headers(scope=scope)), scope)
        scope.setdefault("state", {})[REQUEST_ID] = request.id
        status, begun_s = _FAILED, time.monotonic()

        async def send_noting(message: Message) -> None:
            nonlocal status
            if message["type"] in ("http.response.start", "websocket.http.response.start"):
                status = message["status"]
                MutableHeaders(scope=message)[REQUEST_ID_HEADER] = request.id
            elif message["type"] == "websocket.accept":
                status = 101
            elif message["type"] == "websocket.close" and status == _FAILED:
                status = 403
            await send(message)

        before = asked.set(request)
        try:
            await self._app(scope, receive, send_noting)
        finally:
            self._note(request, status, time.monotonic() - begun_s)
            asked.reset(before)

    def _note(self, request: Asked, status: int, took_s: float) -> None:
        scope = request.scope
        route = getattr(scope.get("route"), "path", None) or _outside(scope)
        method = scope.get("method", "WEBSOCKET")
        services = scope["app"].state.foundation.services
        if scope["type"] == "http":
            services.get(RequestMetrics).note(route, method, status, took_s)
        level = logging.DEBUG if route in _QUIET else logging.INFO
        client = scope.get("client")
        log.log(
            logging.WARNING if status >= _FAILED else level,
            "%s %s %d",
            method,
            route,
            status,
            extra={
                "method": method,
                "route": route,
                "status": status,
                "duration_ms": round(1e3 * took_s, 1),
                "client": None if client is None else client[0],
            },
        )


def _id_of(headers: Headers) -> str:
    given = headers.get(REQUEST_ID_HEADER, "")
    return given if _FOREIGN_ID.fullmatch(given) else secrets.token_hex(8)


def _outside(scope: Scope) -> str:
    """Return what stands for a path that no route of the station takes."""
    return "(files of the app)" if scope.get("endpoint") is not None else "(none)"
