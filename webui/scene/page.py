"""viser's page as the station serves it: whole, or bare for a place inside the operator app."""

import base64
import gzip
import hashlib
import json
import re
from collections.abc import Mapping
from functools import cache
from html import escape
from pathlib import Path
from types import MappingProxyType

import viser

_GROUND = """
:root { --sky: linear-gradient(#161f29, #090d12); }
:root[data-theme="day"] { --sky: linear-gradient(#8fa5b5, #566d7f); }
body { background: var(--sky) !important; }
#root div:has(canvas) { background: none !important; }
"""
"""The sky lies behind the canvas, which draws none: there from the first paint, in each theme."""
_THEN = """
#then { position: fixed; inset: 0 0 auto; z-index: 10; padding: 5px 12px; text-align: center;
  font: 600 14px/1.4 system-ui, sans-serif; color: #1b1300; background: #e0a838;
  pointer-events: none; }
"""
"""The mark of a view of the past, across its upper edge."""
_QUIET = """
.mantine-Notification-root[style*="orange"] { display: none !important; }
"""
"""A film does not tell that no graphics processor draws it."""
_BARE = """
.mantine-Paper-root,
.mantine-Notification-root[style*="orange"] { display: none !important; }
"""
"""The app has its own switches beside the view, and tells there that no graphics processor draws
it; viser's notices of real faults (red) stay."""

_BEFORE = ("frame.js", "pace.js")
"""Our scripts, run before viser's."""
UNPACKED: Mapping[str, str] = MappingProxyType(
    {"1.1.1": "o/BTEGoB4UnTxqb+3RxwUFQZkWXpqUxouHkbDNrAkqE="}
)
"""Hash of the script that viser's page unpacks, by viser's version; a browser tells another's."""
_SCRIPT = re.compile(rb"""<script(?:[^>"']|"[^"]*"|'[^']*')*>(.*?)</script>""", re.DOTALL)
"""An attribute of viser's holds half a megabyte, with angle brackets in it."""


@cache
def page(*, is_framed: bool) -> bytes:
    """Return viser's page, compressed by gzip; ``is_framed`` hides its panel and mild notices."""
    return gzip.compress(_html(is_framed=is_framed), mtime=0)


@cache
def policy() -> str:
    """Return the content security policy of the page: its own scripts, and nothing from elsewhere.

    viser's page holds a script, and within it packed the one that this writes into the page; both
    are named by their hashes. Its widgets write styles.
    """
    hashes = [
        base64.b64encode(hashlib.sha256(script).digest()).decode()
        for script in re.findall(_SCRIPT, _html(is_framed=True))
    ]
    unpacked = UNPACKED.get(viser.__version__)
    named = " ".join(f"'sha256-{one}'" for one in (*hashes, unpacked))
    if unpacked is None:
        named = "'unsafe-inline'"
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src 'self' {named} 'wasm-unsafe-eval' blob:",
            "worker-src blob: data:",
            "style-src 'self' 'unsafe-inline'",
            "img-src 'self' blob: data:",
            "connect-src 'self' blob: data:",
            "font-src 'self' data:",
            "manifest-src 'self'",
            "base-uri 'none'",
            "form-action 'none'",
            "frame-ancestors 'self'",
        )
    )


def recorded_page(recording: bytes, mark: str) -> bytes:
    """Return viser's page with a recording in it, which any browser plays without a station.

    Args:
        recording: As viser serializes it.
        mark: Stands across the upper edge.
    """
    data = base64.b64encode(recording).decode()
    head = (
        f"<style>{_GROUND}{_THEN}{_QUIET}</style><script>window.__VISER_EMBED_DATA__={json.dumps(data)};"
        "window.__VISER_EMBED_CONFIG__={darkMode:true};</script>"
    )
    content = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()
    content = content.replace(b"<head>", f"<head>{head}".encode(), 1)
    return content.replace(b"<body>", f'<body><div id="then">{escape(mark)}</div>'.encode(), 1)


def _html(*, is_framed: bool) -> bytes:
    content = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()
    scripts = [(Path(__file__).parent / name).read_text() for name in _BEFORE]
    before = "".join(f"<script>{script}</script>" for script in scripts)
    style = f"<style>{_GROUND}{_THEN}{_BARE if is_framed else ''}</style>"
    return content.replace(b"<head>", f"<head>{style}{before}".encode(), 1)
