"""Markdown of people as HTML that can do nothing: no raw HTML, no pictures of elsewhere."""

from typing import Final
from urllib.parse import urlsplit

from markdown_it import MarkdownIt
from markdown_it.rules_core import StateCore

_NESTING_MAX: Final = 20
_SCHEMES: Final = ("http", "https")
_LINK: Final = "noopener noreferrer nofollow"


def html_of(text: str) -> str:
    """Return what a text says as HTML: safe to be put into a page, whoever wrote it."""
    return _PARSER.render(text)


def _may_lead(url: str) -> bool:
    """Tell whether a link may lead somewhere: by http or https, or to a path of this station."""
    try:
        parts = urlsplit(url.strip())
    except ValueError:
        return False
    if parts.scheme:
        return parts.scheme.lower() in _SCHEMES and bool(parts.netloc)
    # Browsers take two slashes, and what they read as such, for the beginning of a host's name.
    is_of_a_host = bool(parts.netloc) or url.strip().startswith("//") or "\\" in url
    return not is_of_a_host and ":" not in parts.path.split("/")[0]


def _parser() -> MarkdownIt:
    """Return a parser of CommonMark and tables; what it takes for HTML it shows as text."""
    parser = MarkdownIt("commonmark", {"html": False, "maxNesting": _NESTING_MAX})
    parser.enable(["table", "strikethrough"]).disable(["image", "html_block", "html_inline"])
    parser.validateLink = _may_lead
    parser.core.ruler.push("links that tell nothing", _let_links_tell_nothing)
    return parser


def _let_links_tell_nothing(state: StateCore) -> None:
    """Mark links so that where they lead learns nothing of this page, and cannot reach it."""
    for block in state.tokens:
        for token in block.children or ():
            if token.type == "link_open":
                token.attrSet("rel", _LINK)


_PARSER: Final = _parser()
