"""The operator app as a browser gets it from the station."""

import gzip
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from webui.static import CONTENT_SECURITY_POLICY, mount_app


@pytest.fixture
def dist(tmp_path: Path) -> Path:
    folder = tmp_path / "dist"
    (folder / "assets").mkdir(parents=True)
    (folder / "index.html").write_text("<p>the app</p>")
    (folder / "mark.svg").write_text("<svg/>")
    (folder / "assets" / "index-abc.js").write_text("run()")
    (tmp_path / "secret.txt").write_text("not for browsers")
    return folder


def browser(dist: Path) -> httpx.AsyncClient:
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)

    @app.get("/api/robots")
    def robots() -> list[str]:
        return ["mini-1"]

    mount_app(app, dist)
    return httpx.AsyncClient(
        transport=httpx.ASGITransport(app=app),
        base_url="http://station",
        headers={"Accept": "text/html"},
    )


@pytest.mark.parametrize("path", ["/", "/plan/mini-1", "/robot/v1.2"])
async def test_every_page_of_the_app_is_its_index(dist: Path, path: str) -> None:
    answer = await browser(dist).get(path)
    assert answer.status_code == 200
    assert answer.text == "<p>the app</p>"
    assert answer.headers["cache-control"] == "no-cache"
    assert answer.headers["content-security-policy"] == CONTENT_SECURITY_POLICY


async def test_hashed_assets_are_kept_for_ever_and_other_files_are_not(dist: Path) -> None:
    client = browser(dist)
    asset = await client.get("/assets/index-abc.js")
    assert "immutable" in asset.headers["cache-control"]
    assert "javascript" in asset.headers["content-type"]
    assert (await client.get("/mark.svg")).headers["cache-control"] == "no-cache"


@pytest.mark.parametrize(
    ("accepted", "coding"),
    [
        ("gzip, deflate, br, zstd", "br"),
        ("gzip", "gzip"),
        ("br;q=0, gzip;q=0.5", "gzip"),
        ("*", "br"),
        ("identity", None),
        ("br;q=much", None),
    ],
)
async def test_an_asset_travels_in_the_smallest_coding_that_the_browser_takes(
    dist: Path, accepted: str, coding: str | None
) -> None:
    script = dist / "assets" / "index-abc.js"
    script.with_name("index-abc.js.gz").write_bytes(gzip.compress(script.read_bytes()))
    script.with_name("index-abc.js.br").write_bytes(b"packed")
    headers = {"Accept-Encoding": accepted}
    async with browser(dist).stream("GET", "/assets/index-abc.js", headers=headers) as answer:
        raw = b"".join([part async for part in answer.aiter_raw()])
    assert answer.headers.get("content-encoding") == coding
    assert answer.headers["vary"] == "Accept-Encoding"
    assert "javascript" in answer.headers["content-type"]
    assert "immutable" in answer.headers["cache-control"]
    expected = {"br": b"packed", "gzip": script.with_name("index-abc.js.gz").read_bytes()}
    assert raw == expected.get(coding or "", script.read_bytes())


async def test_a_missing_asset_is_never_answered_with_the_page(dist: Path) -> None:
    answer = await browser(dist).get("/assets/index-old.js", headers={"Accept": "*/*"})
    assert answer.status_code == 404


@pytest.mark.parametrize("path", ["/api/nothing", "/view/mini-1/", "/docs", "/sign-in"])
async def test_addresses_of_the_station_are_not_the_apps(dist: Path, path: str) -> None:
    assert (await browser(dist).get(path)).status_code == 404


async def test_routes_of_the_station_come_first(dist: Path) -> None:
    assert (await browser(dist).get("/api/robots")).json() == ["mini-1"]


@pytest.mark.parametrize(
    "path", ["/../secret.txt", "/%2e%2e/secret.txt", "/assets/%2e%2e/%2e%2e/secret.txt"]
)
async def test_nothing_outside_the_built_app_is_served(dist: Path, path: str) -> None:
    answer = await browser(dist).get(path)
    assert "not for browsers" not in answer.text


async def test_without_a_built_app_a_plain_page_says_how_to_build_it(tmp_path: Path) -> None:
    answer = await browser(tmp_path / "nowhere").get("/")
    assert answer.status_code == 503
    assert "make setup" in answer.text


async def test_a_build_is_seen_without_a_restart(tmp_path: Path) -> None:
    client = browser(tmp_path)
    assert (await client.get("/")).status_code == 503
    (tmp_path / "index.html").write_text("<p>built</p>")
    assert (await client.get("/")).text == "<p>built</p>"


def test_the_policy_allows_nothing_from_elsewhere() -> None:
    assert "default-src 'self'" in CONTENT_SECURITY_POLICY
    assert "unsafe" not in CONTENT_SECURITY_POLICY
    assert "http" not in CONTENT_SECURITY_POLICY


@pytest.fixture
def manual(dist: Path) -> Path:
    (dist / "help" / "images").mkdir(parents=True)
    (dist / "help" / "index.html").write_text("<p>contents</p>")
    (dist / "help" / "alarms.html").write_text("<p>alarms</p>")
    (dist / "help" / "images" / "fleet.png").write_bytes(b"picture")
    return dist


@pytest.mark.parametrize(
    ("path", "status", "text"),
    [
        ("/help", 200, "contents"),
        ("/help/", 200, "contents"),
        ("/help/alarms", 200, "alarms"),
        ("/help/no-such-chapter", 404, "contents"),
        ("/help/images", 404, "contents"),
        ("/help/%2e%2e/secret", 404, "contents"),
        ("/help/..%2findex", 404, "contents"),
        ("/helpless", 200, "the app"),
    ],
)
async def test_the_manual_is_served_by_chapter(
    manual: Path, path: str, status: int, text: str
) -> None:
    answer = await browser(manual).get(path)
    assert (answer.status_code, answer.text) == (status, f"<p>{text}</p>")
    assert answer.headers["content-security-policy"] == CONTENT_SECURITY_POLICY


async def test_pictures_of_the_manual_are_files(manual: Path) -> None:
    answer = await browser(manual).get("/help/images/fleet.png")
    assert answer.content == b"picture"
    assert answer.headers["content-type"] == "image/png"


async def test_without_a_built_manual_there_is_none(dist: Path) -> None:
    assert (await browser(dist).get("/help")).status_code == 404
