"""viser's page as the station serves it: whole, or bare for a place inside the operator app."""

import gzip
from functools import cache
from pathlib import Path

import viser

_BARE = """
.mantine-Paper-root,
.mantine-Notification-root[style*="orange"] { display: none !important; }
"""
"""The app has its own switches beside the view, and tells there that no graphics processor draws
it; viser's notices of real faults (red) stay."""


@cache
def page(*, is_framed: bool) -> bytes:
    """Return viser's page, compressed by gzip; ``is_framed`` hides its panel and mild notices."""
    content = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()
    if is_framed:
        content = content.replace(b"</head>", f"<style>{_BARE}</style></head>".encode(), 1)
    return gzip.compress(content, mtime=0)
