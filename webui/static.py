"""Serves the built operator app beside the station's own routes."""

from importlib.resources import files
from mimetypes import guess_type
from pathlib import Path
from typing import Final

from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse, HTMLResponse
from starlette.exceptions import HTTPException

CONTENT_SECURITY_POLICY: Final = "; ".join(
    (
        "default-src 'self'",
        "img-src 'self' data:",
        "object-src 'none'",
        "base-uri 'none'",
        "form-action 'self'",
        "frame-ancestors 'none'",
    )
)
"""The app loads nothing from elsewhere, and no other page may frame it. It draws the icon of its
tab, which a browser takes as a ``data:`` picture alone."""
STATION_ROOTS: Final = frozenset({"api", "view", "docs", "redoc", "openapi.json", "sign-in", "ack"})
"""First parts of addresses that are the station's; the app has no page there."""
MANUAL_ROOT: Final = "help"
"""First part of the addresses of the operator's manual, which needs no sign-in."""
ENCODINGS: Final = {"br": ".br", "gzip": ".gz"}
"""Content codings that the build wrote files in, the smallest first, and how their names end."""
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
        return _answer(root, path, request)


def _answer(root: Path, path: str, request: Request) -> Response:
    index = root / "index.html"
    if not index.is_file():
        return HTMLResponse(_NOT_BUILT, status_code=503, headers=_headers(_ASK_AGAIN))
    if path.split("/", 1)[0] == MANUAL_ROOT and not Path(path).suffix:
        return _manual_page(root, path, request)
    wanted = (root / path).resolve()
    if wanted != index and wanted.is_relative_to(root) and wanted.is_file():
        hashed = wanted.is_relative_to(root / "assets")
        return _file(wanted, _FOR_EVER if hashed else _ASK_AGAIN, request)
    if Path(path).suffix and "text/html" not in request.headers.get("accept", ""):
        # A missing asset must not look like one: the page in its place would be run as a script.
        raise HTTPException(404)
    return _file(index, _ASK_AGAIN, request)


def _manual_page(root: Path, path: str, request: Request) -> Response:
    """Return a chapter; its contents where it has none of that name, with a 404."""
    manual = root / MANUAL_ROOT
    chapter = (root / f"{path}.html").resolve()
    if chapter.parent == manual and chapter.is_file():
        return _file(chapter, _ASK_AGAIN, request)
    contents = manual / "index.html"
    if not contents.is_file():
        raise HTTPException(404)
    status = 200 if path.rstrip("/") == MANUAL_ROOT else 404
    return _file(contents, _ASK_AGAIN, request, status)


def _file(path: Path, cache: str, request: Request, status: int = 200) -> Response:
    """Return a file in the smallest coding that it exists in and that is asked for."""
    headers = _headers(cache) | {"Vary": "Accept-Encoding"}
    kind = guess_type(path.name)[0]
    for coding in _accepted(request.headers.get("accept-encoding", "")):
        packed = path.with_name(path.name + ENCODINGS[coding])
        if packed.is_file():
            return FileResponse(
                packed, status, media_type=kind, headers=headers | {"Content-Encoding": coding}
            )
    return FileResponse(path, status, media_type=kind, headers=headers)


def _accepted(header: str) -> list[str]:
    """Return the content codings that a browser takes and the build may have written."""
    asked: dict[str, float] = {}
    for part in header.split(","):
        name, _, weight = part.partition(";")
        try:
            asked[name.strip().lower()] = float(weight.partition("=")[2] or 1.0)
        except ValueError:
            continue
    return [coding for coding in ENCODINGS if asked.get(coding, asked.get("*", 0.0)) > 0.0]


def _headers(cache: str) -> dict[str, str]:
    return {
        "Cache-Control": cache,
        "Content-Security-Policy": CONTENT_SECURITY_POLICY,
        "X-Content-Type-Options": "nosniff",
    }
