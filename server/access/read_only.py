"""What a read-only link shows: these routes alone, and of them no more than anybody may know.

A route that is not in the list is closed to links, so that a new one shows nothing by mistake.
"""

from typing import Final

LINK_ROUTES: Final = frozenset(
    {
        "/api/session",
        "/api/live",
        "/api/alarms",
        "/api/channels",
        "/api/demo/faults",
        "/api/base-maps",
        "/api/base-maps/{base_map}/tiles/{z}/{x}/{y}",
        "/api/waters/{water}",
        "/api/waters/{water}/outline",
        "/api/waters/{water}/depths",
        "/api/robots",
        "/api/robots/{robot}",
        "/api/robots/{robot}/state",
        "/api/robots/{robot}/samples",
        "/api/robots/{robot}/channels",
        "/api/robots/{robot}/track",
        "/api/robots/{robot}/maps",
        "/api/robots/{robot}/maps/choices",
        "/api/robots/{robot}/maps/{variable}",
        "/api/robots/{robot}/prediction",
        "/api/robots/{robot}/current",
        "/api/robots/{robot}/current/at",
        "/api/robots/{robot}/current/flow",
        "/api/robots/{robot}/view",
        "/view/",
        "/view/{robot}/",
        "/view/{robot}",
    }
)
"""Paths that may be read; what is not read is refused."""


def is_open_to_links(method: str, path: str) -> bool:
    """Tell whether a link may ask for a route; ``method`` is empty for a WebSocket."""
    if path == "/api/session":
        return method in {"GET", "HEAD", "DELETE"}
    return path in LINK_ROUTES and method in {"", "GET", "HEAD"}
