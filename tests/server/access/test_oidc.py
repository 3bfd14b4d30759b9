"""Signing in by a provider of OpenID Connect, against one that runs as a process of its own."""

import json
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest
from fastapi import FastAPI

from server.access.role import Role
from tests.server.station_app import BASE_URL, admin_of, client_of, running

ROLES = {"group:glider-pilots": "pilot", "email:cho@example.org": "admin"}
PEOPLE = [
    {"sub": "ben-1", "preferred_username": "ben", "groups": ["glider-pilots"]},
    {"sub": "cho-1", "preferred_username": "cho", "email": "cho@example.org",
     "email_verified": True},
    {"sub": "dan-1", "preferred_username": "dan", "email": "cho@example.org",
     "email_verified": False},
    {"sub": "ann-2", "preferred_username": "ann", "groups": ["glider-pilots"]},
]  # fmt: skip


@contextmanager
def closed_port() -> Iterator[int]:
    """Give a port at which nobody listens, and that nobody else gets meanwhile."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        yield one.getsockname()[1]


@pytest.fixture(scope="module")
def issuer() -> Iterator[str]:
    people = [part for person in PEOPLE for part in ("--user-claims", json.dumps(person))]
    for _ in range(5):  # somebody else may take the port before the provider does
        with closed_port() as port:
            issuer = f"http://127.0.0.1:{port}"
        command = [sys.executable, "-m", "oidc_provider_mock", "--port", str(port), *people]
        with subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        ) as process:
            try:
                if serves(f"{issuer}/.well-known/openid-configuration", process):
                    yield issuer
                    return
            finally:
                process.terminate()
    raise AssertionError("the provider has ended")


def serves(address: str, process: subprocess.Popen[bytes]) -> bool:
    """Wait until a process serves an address; tell whether it does, or has ended."""
    while process.poll() is None:
        with suppress(httpx.HTTPError):
            httpx.get(address, timeout=60)
            return process.poll() is None
        time.sleep(0.1)
    return False


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no answer of the provider come too late, however busy the machine is."""
    monkeypatch.setattr("server.access.oidc.provider.PATIENCE_S", 60.0)


@pytest.fixture
async def app(tmp_path: Path, issuer: str) -> AsyncIterator[FastAPI]:
    settings = {"oidc_issuer": issuer, "oidc_client_id": "grace", "oidc_client_secret": "secret"}
    async with running(tmp_path, **settings, oidc_roles=ROLES) as app:
        yield app


async def at_provider(address: str, subject: str) -> str:
    """Let somebody sign in at the provider; return where it sends them."""
    async with httpx.AsyncClient(timeout=60) as provider:
        answer = await provider.post(address, data={"sub": subject})
    assert answer.is_redirect, answer.text
    return answer.headers["location"]


async def signed_in_by_provider(browser: httpx.AsyncClient, subject: str) -> httpx.Response:
    begun = await browser.get("/sign-in/oidc")
    assert begun.status_code == 303
    back = await at_provider(begun.headers["location"], subject)
    assert back.startswith(f"{BASE_URL}/sign-in/oidc/back?")
    return await browser.get(back.removeprefix(BASE_URL))


def refusal(answer: httpx.Response) -> str:
    assert answer.status_code == 303
    return parse_qs(urlsplit(answer.headers["location"]).fragment)["refused"][0]


async def test_group_and_verified_address_give_roles(app: FastAPI):
    for subject, name, role in (("ben-1", "ben", Role.PILOT), ("cho-1", "cho", Role.ADMIN)):
        for _ in range(2):  # the second time as the same person
            async with client_of(app) as browser:
                done = await signed_in_by_provider(browser, subject)
                assert done.headers["location"] == "/"
                session = (await browser.get("/api/session")).json()
                assert (session["name"], session["role"]) == (name, role)


async def test_address_that_nobody_verified_gives_no_role(app: FastAPI):
    async with client_of(app) as browser:
        assert "nobody gave you a role" in refusal(await signed_in_by_provider(browser, "dan-1"))
        assert (await browser.get("/api/session")).status_code == 401


async def test_name_of_a_person_here_is_no_proof_of_being_them(app: FastAPI):
    async with admin_of(app), client_of(app) as browser:
        assert "called ann here already" in refusal(await signed_in_by_provider(browser, "ann-2"))


async def test_request_carries_challenge_state_and_nonce(app: FastAPI):
    async with client_of(app) as browser:
        begun = await browser.get("/sign-in/oidc")
    asked = parse_qs(urlsplit(begun.headers["location"]).query)
    assert asked["code_challenge_method"] == ["S256"]
    assert {"state", "nonce", "code_challenge"} <= set(asked)
    assert asked["redirect_uri"] == [f"{BASE_URL}/sign-in/oidc/back"]


async def test_return_is_good_once_and_in_its_own_browser(app: FastAPI):
    async with client_of(app) as browser, client_of(app) as other:
        begun = await browser.get("/sign-in/oidc")
        back = (await at_provider(begun.headers["location"], "ben-1")).removeprefix(BASE_URL)
        assert "did not begin in this browser" in refusal(await other.get(back))
        kept = dict(browser.cookies)
        assert (await browser.get(back)).headers["location"] == "/"
        browser.cookies.update(kept)
        assert "took too long" in refusal(await browser.get(back))


async def test_code_of_another_sign_in_proves_nothing(app: FastAPI):
    async with client_of(app) as browser:
        first = await browser.get("/sign-in/oidc")
        stolen = await at_provider(first.headers["location"], "ben-1")
        code = parse_qs(urlsplit(stolen).query)["code"][0]
        second = await browser.get("/sign-in/oidc")
        state = parse_qs(urlsplit(second.headers["location"]).query)["state"][0]
        answer = await browser.get("/sign-in/oidc/back", params={"state": state, "code": code})
        assert refusal(answer)
        assert (await browser.get("/api/session")).status_code == 401


async def test_refusal_of_the_provider_is_told(app: FastAPI):
    async with client_of(app) as browser:
        begun = await browser.get("/sign-in/oidc")
        state = parse_qs(urlsplit(begun.headers["location"]).query)["state"][0]
        asked = {"state": state, "error": "access_denied"}
        assert "did not let you in" in refusal(
            await browser.get("/sign-in/oidc/back", params=asked)
        )


async def test_provider_that_is_down_keeps_nobody_from_their_password(tmp_path: Path):
    with closed_port() as port:
        settings = {"oidc_issuer": f"http://127.0.0.1:{port}", "oidc_client_id": "grace"}
        async with running(tmp_path, **settings, oidc_roles=ROLES) as app, admin_of(app) as admin:
            title = (await admin.get("/api/session/provider")).json()
            assert title == {"title": "your organisation"}
            assert "does not answer" in refusal(await admin.get("/sign-in/oidc"))
            assert (await admin.get("/api/session")).json()["name"] == "ann"


async def test_station_without_a_provider_offers_none(tmp_path: Path):
    async with running(tmp_path) as app, client_of(app) as browser:
        assert (await browser.get("/api/session/provider")).json() == {"title": None}
        assert "no sign-in provider" in refusal(await browser.get("/sign-in/oidc"))
