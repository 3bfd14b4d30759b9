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
    """Return viser's page, compressed by gzip.

    Args:
        is_framed: Hides its panel and mild notices, and paces its pictures where no graphics
            processor draws them.
    """
    content = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()
    if is_framed:
        pace = (Path(__file__).parent / "pace.js").read_bytes()
        content = content.replace(b"<head>", b"<head><script>" + pace + b"</script>", 1)
        content = content.replace(b"</head>", f"<style>{_BARE}</style></head>".encode(), 1)
    return gzip.compress(content, mtime=0)
