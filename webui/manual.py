"""Renders the operator's manual, ``docs/manual``, to pages that the station serves at ``/help``.

The contents, ``README.md`` there, name the chapters in their order, each by its last mention. A
link or a picture that leads nowhere stops the build. Of each section the words go into one file,
in which the page searches.
"""

import json
import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Final

from markdown_it import MarkdownIt
from markdown_it.token import Token

CONTENTS: Final = "README.md"
SECTIONS: Final = "sections.json"
PICTURES: Final = "images"
_PNG_SIZE: Final = slice(16, 24)


class ManualError(Exception):
    """The manual cannot be rendered; the message names the chapter and what is wrong in it."""


@dataclass(frozen=True, slots=True)
class Section:
    """What stands under one heading, as it is searched."""

    anchor: str
    title: str
    text: str


@dataclass(slots=True)
class Chapter:
    """One rendered file of the manual."""

    key: str
    title: str
    html: str
    sections: list[Section]
    links: list[str] = field(default_factory=list[str])
    """Chapters and sections that it links to: ``key`` or ``key#anchor``."""
    pictures: list[str] = field(default_factory=list[str])


def address(key: str) -> str:
    """Return where the station serves a chapter; the contents are ``""``."""
    return f"/help/{key}" if key else "/help"


def read_manual(folder: Path) -> list[Chapter]:
    """Return the contents and the chapters in their order.

    Raises:
        ManualError: If a chapter is missing or not among the contents, or a link leads nowhere.
    """
    contents = render(folder, CONTENTS)
    named = [link.split("#")[0] for link in contents.links]
    order = [key for key in dict.fromkeys(reversed(named)) if key][::-1]
    files = {path.stem for path in folder.glob("*.md")} - {Path(CONTENTS).stem}
    if left_out := files - set(order):
        raise ManualError(f"{CONTENTS} does not name {', '.join(sorted(left_out))}")
    chapters = [contents, *(render(folder, f"{key}.md") for key in order)]
    known = {chapter.key for chapter in chapters} | {
        f"{chapter.key}#{section.anchor}" for chapter in chapters for section in chapter.sections
    }
    for chapter in chapters:
        if dangling := [link for link in chapter.links if link not in known]:
            raise ManualError(f"{chapter.key or CONTENTS} links to {', '.join(dangling)}")
    return chapters


def render(folder: Path, name: str) -> Chapter:
    """Render one file.

    Raises:
        ManualError: If it is missing, has no title, or names a picture that is not there.
    """
    path = folder / name
    if not path.is_file():
        raise ManualError(f"{CONTENTS} names {name}, which is missing")
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(path.read_text(encoding="utf-8"))
    chapter = Chapter("" if name == CONTENTS else path.stem, "", "", [])
    _name_headings(tokens)
    for token in _inline(tokens):
        if token.type == "link_open":
            token.attrs["href"] = _link(chapter, str(token.attrs["href"]))
        elif token.type == "image":
            _place_picture(chapter, token, folder)
    chapter.sections = list(_sections(tokens))
    if not chapter.sections or tokens[0].tag != "h1":
        raise ManualError(f"{name} does not begin with its title")
    chapter.title = chapter.sections[0].title
    chapter.html = str(parser.renderer.render(tokens, parser.options, {}))
    return chapter


def _inline(tokens: Sequence[Token]) -> Iterator[Token]:
    return (child for token in tokens for child in token.children or ())


def _name_headings(tokens: Sequence[Token]) -> None:
    """Give each heading the anchor that it would have on a page of a repository."""
    for opening, inline in pairwise(tokens):
        if opening.type == "heading_open":
            opening.attrs["id"] = anchor(_plain(inline))


def anchor(title: str) -> str:
    """Return the anchor of a heading."""
    return re.sub(r"\s+", "-", re.sub(r"[^\w\s-]", "", title.lower()).strip())


def _plain(inline: Token) -> str:
    kinds = {"text", "code_inline"}
    parts = (
        child.content if child.type in kinds else " " if "break" in child.type else ""
        for child in inline.children or ()
    )
    return "".join(parts)


def _sections(tokens: Sequence[Token]) -> Iterator[Section]:
    heading: Token | None = None
    title, words = "", list[str]()
    for token in tokens:
        if token.type == "heading_open":
            if heading is not None:
                yield Section(str(heading.attrs["id"]), title, " ".join(words))
            heading, title, words = token, "", []
        elif token.type == "inline":
            if heading is not None and not title:
                title = _plain(token)
            else:
                words.append(_plain(token))
        elif token.type in ("fence", "code_block"):
            words.append(token.content.strip())
        elif token.type in ("th_close", "td_close"):
            words.append("·")
    if heading is not None:
        yield Section(str(heading.attrs["id"]), title, " ".join(words))


def _link(chapter: Chapter, href: str) -> str:
    target, _, part = href.partition("#")
    if target and ("/" in target or not target.endswith(".md")):
        raise ManualError(f"{chapter.key or CONTENTS} links to {href}, which is outside the manual")
    key = "" if target == CONTENTS else target.removesuffix(".md") or chapter.key
    chapter.links.append(f"{key}#{part}" if part else key)
    return f"{address(key)}#{part}" if part else address(key)


def _place_picture(chapter: Chapter, token: Token, folder: Path) -> None:
    source = str(token.attrs["src"])
    path = folder / source
    if not source.startswith(f"{PICTURES}/") or not path.is_file():
        raise ManualError(f"{chapter.key} shows {source}, which is missing")
    width, height = struct.unpack(">II", path.read_bytes()[_PNG_SIZE])
    token.attrs |= {
        "src": f"/help/{source}", "width": width, "height": height, "loading": "lazy",
    }  # fmt: skip
    chapter.pictures.append(source)


def write_pages(folder: Path, template: str, into: Path) -> None:
    """Write each chapter as a page, what is searched, and the pictures.

    Args:
        folder: The manual's source.
        template: A page with the marks ``<!--title-->``, ``<!--chapters-->`` and ``<!--text-->``.
        into: Folder of the pages; it may exist.
    """
    chapters = read_manual(folder)
    (into / PICTURES).mkdir(parents=True, exist_ok=True)
    for number, chapter in enumerate(chapters):
        text = chapter.html
        if chapter.key:
            beside = chapters[number - 1], chapters[(number + 1) % len(chapters)]
            text += _beside(*beside)
        page = (
            template.replace("<!--title-->", escape(chapter.title))
            .replace("<!--chapters-->", _navigation(chapters, chapter))
            .replace("<!--text-->", text)
        )
        (into / f"{chapter.key or 'index'}.html").write_text(page, encoding="utf-8")
        for picture in chapter.pictures:
            (into / picture).write_bytes((folder / picture).read_bytes())
    found = [
        {
            "address": address(chapter.key) + (f"#{section.anchor}" if number else ""),
            "chapter": chapter.title,
            "title": section.title,
            "text": section.text,
        }
        for chapter in chapters[1:]
        for number, section in enumerate(chapter.sections)
    ]
    (into / SECTIONS).write_text(json.dumps(found, ensure_ascii=False), encoding="utf-8")


def _navigation(chapters: Sequence[Chapter], here: Chapter) -> str:
    def item(chapter: Chapter) -> str:
        mark = ' aria-current="page"' if chapter is here else ""
        return f'<li><a href="{address(chapter.key)}"{mark}>{escape(chapter.title)}</a></li>'

    return f"<ul>{''.join(map(item, chapters))}</ul>"


def _beside(before: Chapter, after: Chapter) -> str:
    return (
        '<nav class="beside" aria-label="Chapters beside">'
        f'<a href="{address(before.key)}" rel="prev">← {escape(before.title)}</a>'
        f'<a href="{address(after.key)}" rel="next">{escape(after.title)} →</a></nav>'
    )
