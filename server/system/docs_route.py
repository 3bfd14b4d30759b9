"""The REST interface on a page that needs nothing from elsewhere and no script."""

import re
from html import escape
from itertools import groupby
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from server.base.dependency import FoundationDep
from server.base.problem import ERROR_FAMILIES

router = APIRouter()
_METHODS = ("get", "post", "patch", "put", "delete")
_STYLE = """
:root { color-scheme: light dark; --line: #8884; --accent: #3b82f6; }
body { font: 14px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h2 { margin-top: 2rem; text-transform: capitalize; }
details { border: 1px solid var(--line); border-radius: 6px; margin: 4px 0; padding: 4px 12px; }
summary { cursor: pointer; }
code, pre { font: 13px/1.45 ui-monospace, monospace; }
pre { white-space: pre-wrap; border-left: 3px solid var(--line); padding-left: 12px; }
.method { display: inline-block; width: 4.5rem; font-weight: 700; color: var(--accent); }
.mark { background: #e0a838; color: #000; font-weight: 700; padding: 4px 12px; }
.text { margin-left: 1rem; opacity: .8; }
"""


@router.get("/docs", include_in_schema=False)
async def show_docs(request: Request, foundation: FoundationDep) -> HTMLResponse:
    """Return every operation with its parameters, body and answers."""
    simulation = foundation.settings.simulation
    return HTMLResponse(
        docs_page(request.app.openapi(), simulation=simulation),
        headers={"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'"},
    )


def docs_page(openapi: dict[str, Any], *, simulation: bool) -> str:
    """Render an OpenAPI document as HTML, marked where the robots do not exist."""
    operations = [
        (operation.get("tags", ["other"])[0], path, method, operation)
        for path, item in openapi["paths"].items()
        for method, operation in item.items()
        if method in _METHODS
    ]
    operations.sort(key=lambda entry: (entry[0], entry[1], _METHODS.index(entry[2])))
    schemas = openapi.get("components", {}).get("schemas", {})
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8>",
        "<meta name=viewport content='width=device-width'>",
        f"<title>{escape(openapi['info']['title'])}: REST</title><style>{_STYLE}</style>",
        "<p class=mark>SIMULATION</p>" if simulation else "",
        f"<h1>{escape(openapi['info']['title'])}</h1>",
        "<p>Sign in by cookie (changes need the header <code>X-CSRF-Token</code>) or send ",
        "<code>Authorization: Bearer &lt;token&gt;</code>. Times are RFC 3339 in UTC; units are ",
        "SI and stand in the names. Errors are problem details. The machine-readable form is ",
        "<a href=/openapi.json>/openapi.json</a>; the live stream is the WebSocket ",
        "<code>/api/live?robots=&amp;after=</code>.</p>",
    ]
    for tag, group in groupby(operations, key=lambda entry: entry[0]):
        parts.append(f"<h2>{escape(tag)}</h2>")
        parts.extend(_operation(path, method, op) for _, path, method, op in group)
    parts.append("<h2>shapes</h2>")
    parts.extend(_shape(name, schema) for name, schema in sorted(schemas.items()))
    return "".join([*parts, "</html>"])


def _operation(path: str, method: str, operation: dict[str, Any]) -> str:
    rows = [
        f"<li><code>{escape(p['name'])}</code> ({escape(p['in'])}): "
        f"{_type(p.get('schema', {}))} {_text(p.get('description', ''))}</li>"
        for p in operation.get("parameters", [])
    ]
    body = operation.get("requestBody", {}).get("content", {})
    rows.extend(
        f"<li>body <code>{escape(media)}</code>: {_type(content.get('schema', {}))}</li>"
        for media, content in body.items()
    )
    for status, answer in operation.get("responses", {}).items():
        if status in {"422", *ERROR_FAMILIES}:
            continue
        shapes = [_type(c["schema"]) for c in answer.get("content", {}).values() if "schema" in c]
        rows.append(
            f"<li>{escape(status)}: {' '.join(shapes) or escape(answer['description'])}</li>"
        )
    summary = operation.get("description") or operation.get("summary", "")
    return (
        f"<details><summary><span class=method>{method.upper()}</span><code>{escape(path)}</code>"
        f"<span class=text>{_text(summary.splitlines()[0])}</span></summary>"
        f"<p>{_text(summary)}</p><ul>{''.join(rows)}</ul></details>"
    )


def _shape(name: str, schema: dict[str, Any]) -> str:
    required = set(schema.get("required", []))
    rows = [
        f"<li><code>{escape(field)}</code>{'' if field in required else ' (optional)'}: "
        f"{_type(value)} {_text(value.get('description', ''))}</li>"
        for field, value in schema.get("properties", {}).items()
    ]
    text = _text(schema.get("description", ""))
    return (
        f"<details id='{escape(name)}'><summary><code>{escape(name)}</code></summary>"
        f"<p>{text}</p><ul>{''.join(rows)}</ul></details>"
    )


def _text(words: str) -> str:
    """Escape a sentence; what stands in double backquotes is code."""
    return re.sub(r"``(.+?)``", r"<code>\1</code>", escape(words))


def _type(schema: dict[str, Any]) -> str:
    """Return the words for a schema; a named shape is a link to it."""
    if "$ref" in schema:
        name = escape(schema["$ref"].rsplit("/", 1)[1])
        return f"<a href='#{name}'>{name}</a>"
    for several in ("anyOf", "oneOf", "allOf"):
        if several in schema:
            return " or ".join(_type(option) for option in schema[several])
    if "enum" in schema:
        return " | ".join(f"<code>{escape(str(value))}</code>" for value in schema["enum"])
    if schema.get("type") == "array":
        return f"list of {_type(schema.get('items', {}))}"
    if "const" in schema:
        return f"<code>{escape(str(schema['const']))}</code>"
    return escape(str(schema.get("format") or schema.get("type") or "anything"))
