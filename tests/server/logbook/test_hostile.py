"""Hostile words and pictures: what people write cannot do anything in the browsers of others."""

import io
import re
import struct
import time
import zlib
from hashlib import sha256
from html.parser import HTMLParser

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from server.logbook.markdown import html_of
from server.logbook.picture import PictureError, checked
from server.logbook.view import TEXT_LENGTH_MAX

PICTURES = "/api/logbook/attachments"
KNOWN = {
    "a", "blockquote", "br", "code", "em", "h1", "h2", "h3", "h4", "h5", "h6", "hr", "li", "ol",
    "p", "pre", "s", "strong", "table", "tbody", "td", "th", "thead", "tr", "ul",
}  # fmt: skip


class Seen(HTMLParser):
    """What a browser would make of HTML: its tags and their attributes."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.attributes = set(), []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.attributes += attrs


def assert_harmless(html):
    seen = Seen(html)
    assert seen.tags <= KNOWN, html
    for name, value in seen.attributes:
        assert name in {"href", "rel", "title", "class", "start", "style"}, html
        if name == "href":
            assert not re.match(r"\s*(javascript|data|vbscript|file):", value, re.I), html
            assert not value.startswith(("//", "\\")), html
        if name == "style":
            assert re.fullmatch(r"text-align:(left|right|center)", value), html


HOSTILE = (
    "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "[a](javascript:alert(1))",
    "[a](JaVaScRiPt:alert(1))",
    "[a](&#106;avascript:alert(1))",
    "[a](java\tscript:alert(1))",
    "[a](  javascript:alert(1))",
    "[a](data:text/html;base64,PHNjcmlwdD4=)",
    "[a](vbscript:x)",
    "[a](//evil.example/x)",
    "[a](\\\\evil.example\\x)",
    "[a](/\\evil.example)",
    "<javascript:alert(1)>",
    "![x](https://evil.example/beacon.png)",
    "![x](javascript:alert(1))",
    '[a](/x "onmouseover=alert(1)")',
    "[a](/x' onclick=\"alert(1))",
    "[a]: javascript:alert(1)\n\n[a]",
    "| a |\n|---|\n| <b onclick=x> |",
    "```html\n</code></pre><script>alert(1)</script>\n```",
    '```"><script>alert(1)</script>\nx\n```',
    "<!-- --><iframe src=//evil.example></iframe>",
    "<a href='javascript:alert(1)'>x</a>",
    "\u2028<svg/onload=alert(1)>",
)


@pytest.mark.parametrize("text", HOSTILE)
def test_nothing_runs_and_nothing_is_loaded_from_elsewhere(text):
    html = html_of(text)
    assert_harmless(html)
    assert "<img" not in html
    assert "<script" not in html


PIECES = st.sampled_from(
    ["<", ">", '"', "'", "&", "[", "](", ")", "javascript:", "!", "`", "\n", "*", "|", "---", "x",
     "data:", "//", "&#x6a;", "\\", " onclick=", "<a ", "://", "# ", "> ", "\t", "ftp:"]
)  # fmt: skip


@settings(deadline=None, max_examples=300)
@given(st.lists(PIECES, max_size=40).map("".join))
def test_no_words_make_a_page_do_anything(text):
    assert_harmless(html_of(text))


def test_a_link_says_nothing_of_where_it_was_followed():
    assert 'rel="noopener noreferrer nofollow"' in html_of("[a](https://example.org)")
    assert 'href="/robot/mini-1?at=2026-11-27T21:00:00Z"' in html_of(
        "[then](/robot/mini-1?at=2026-11-27T21:00:00Z)"
    )


@pytest.mark.parametrize("piece", [">", "*_", "[", "![", "`a", "<a", "- ", "a|", "[](", "&#x"])
def test_the_longest_text_is_made_in_no_time(piece):
    text = (piece * TEXT_LENGTH_MAX)[:TEXT_LENGTH_MAX]
    begun = time.process_time()
    html_of(text)
    assert time.process_time() - begun < 5.0


def picture(kind="PNG", size=(4, 3)):
    file = io.BytesIO()
    Image.new("RGB", size, "red").save(file, kind)
    return file.getvalue()


def png_of(width, height):
    def chunk(kind, data):
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")


async def send(client, data, name="a.png", kind="image/png"):
    return await client.post(PICTURES, files={"file": (name, data, kind)})


@pytest.mark.parametrize(("kind", "media"), [("PNG", "png"), ("JPEG", "jpeg"), ("WEBP", "webp")])
async def test_a_picture_is_kept_under_its_hash_and_served_as_what_it_is(client, kind, media):
    data = picture(kind)
    answer = await send(client, data, "../<script>.html", "text/html")
    assert answer.status_code == 201, answer.text
    kept = answer.json()
    assert (kept["sha256"], kept["media_type"]) == (sha256(data).hexdigest(), f"image/{media}")
    got = await client.get(f"{PICTURES}/{kept['sha256']}")
    assert (got.content, got.headers["content-type"]) == (data, f"image/{media}")
    assert got.headers["x-content-type-options"] == "nosniff"
    assert got.headers["content-security-policy"] == "default-src 'none'; sandbox"
    body = {"text": "See.", "attachments": [{"sha256": kept["sha256"], "name": "pump.png"}]}
    entry = (await client.post("/api/logbook/entries", json=body)).json()
    assert entry["newest"]["attachments"] == [kept | {"name": "pump.png"}]


SVG = b'<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg" onload="alert(1)"/>'


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (SVG, "SVG"),
        (b"<html><script>alert(1)</script>", "neither"),
        (b"GIF89a" + bytes(30), "neither"),
        (b"", "neither"),
        (picture() + b"<script>alert(1)</script>", "behind the end"),
        (picture() + b"PK\x03\x04" + bytes(40), "behind the end"),
        (picture()[:-5], "fit"),
        (b"\x89PNG\r\n\x1a\n" + SVG, "fit"),
        (b"\xff\xd8\xff" + SVG, "fit"),
        (picture("JPEG")[:-40], "breaks off"),
        (picture("WEBP") + b"<script>", "as long as it says"),
        (b"RIFF\x04\x00\x00\x00WEBP", "begin"),
        (png_of(60_000, 60_000), "pixels"),
        (png_of(16_000, 16_000), "pixels"),
        (png_of(0, 5), "pixels"),
        (picture() + bytes(10 * 2**20), "10 MB"),
    ],
)
async def test_what_is_no_picture_is_refused_by_its_bytes(client, data, words):
    answer = await send(client, data)
    assert answer.status_code == 422, answer.text
    assert words in answer.json()["detail"]


async def test_a_huge_upload_is_cut_short(client):
    assert (await send(client, bytes(12 * 2**20))).status_code == 413


def test_what_follows_the_end_of_a_jpeg_is_not_kept():
    data = picture("JPEG")
    assert checked(data + b"<script>alert(1)</script>") == ("image/jpeg", data)


@settings(deadline=None, max_examples=200)
@given(
    st.sampled_from([picture("PNG"), picture("JPEG"), picture("WEBP")]),
    st.lists(st.tuples(st.integers(0, 400), st.integers(0, 255)), min_size=1, max_size=8),
)
def test_a_damaged_picture_is_taken_or_refused_and_never_a_failure(data, changes):
    bytes_ = bytearray(data)
    for at, value in changes:
        bytes_[at % len(bytes_)] = value
    try:
        media_type, kept = checked(bytes(bytes_))
    except PictureError:
        return
    assert media_type.startswith("image/")
    assert len(kept) <= len(bytes_)


async def test_a_path_is_no_hash(client):
    assert (await client.get(f"{PICTURES}/..%2f..%2fstation.sqlite3")).status_code in (404, 422)
    assert (await client.get(f"{PICTURES}/{'0' * 64}")).status_code == 404
