"""Serves the built operator app beside the station's own routes."""

from importlib.resources import files
from pathlib import Path
from typing import Final

from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse, HTMLResponse
from starlette.exceptions import HTTPException

CONTENT_SECURITY_POLICY: Final = "; ".join(
    (
        "default-src 'self'",
        "object-src 'none'",
        "base-uri 'none'",
        "form-action 'self'",
        "frame-ancestors 'none'",
    )
)
"""The app loads nothing from elsewhere, and no other page may frame it."""
STATION_ROOTS: Final = frozenset({"api", "view", "docs", "redoc", "openapi.json", "sign-in"})
"""First parts of addresses that are the station's; the app has no page there."""
_FOR_EVER: Final = "public, max-age=31536000, immutable"
_ASK_AGAIN: Final = "no-cache"
_NOT_BUILT: Final = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Grace Ground Station</title>
<h1>The operator app is not built</h1>
<p>The station runs and answers by REST (see <a href="/docs">/docs</a>), but its pages are missing.
Run <code>make setup</code> where the station was installed, then load this page again.</p>
</html>
"""


def mount_app(app: FastAPI, dist: Path | None = None) -> None:
    """Serve the operator app at every address that no route added before answers.

    Call it after all routers. A file's own address gives the file; any other address gives the
    app's page, whose own router then reads it. Without a built app, a plain page says how to
    build it; the check is made on each request, so a build needs no restart.

    Args:
        app: Application that has its routes already.
        dist: Folder of the built app; the one inside the package where ``None``.
    """
    root = (Path(str(files("webui") / "dist")) if dist is None else dist).resolve()

    @app.get("/{path:path}", include_in_schema=False)
    def serve_app(request: Request, path: str) -> Response:
        if path.split("/", 1)[0] in STATION_ROOTS:
            raise HTTPException(404)
        return _answer(root, path, wants_page="text/html" in request.headers.get("accept", ""))


def _answer(root: Path, path: str, *, wants_page: bool) -> Response:
    index = root / "index.html"
    if not index.is_file():
        return HTMLResponse(_NOT_BUILT, status_code=503, headers=_headers(_ASK_AGAIN))
    wanted = (root / path).resolve()
    if wanted != index and wanted.is_relative_to(root) and wanted.is_file():
        hashed = wanted.is_relative_to(root / "assets")
        return FileResponse(wanted, headers=_headers(_FOR_EVER if hashed else _ASK_AGAIN))
    if Path(path).suffix and not wants_page:
        # A missing asset must not look like one: the page in its place would be run as a script.
        raise HTTPException(404)
    return FileResponse(index, headers=_headers(_ASK_AGAIN))


def _headers(cache: str) -> dict[str, str]:
    return {
        "Cache-Control": cache,
        "Content-Security-Policy": CONTENT_SECURITY_POLICY,
        "X-Content-Type-Options": "nosniff",
    }
