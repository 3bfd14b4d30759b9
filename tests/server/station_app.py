"""The foundation of a station in this process, and a client that is signed in to it."""

from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from datetime import timedelta
from pathlib import Path

import httpx
from fastapi import FastAPI
from sqlalchemy.orm import Session

from server.access import register
from server.access.role import Role
from server.app import create_app
from server.base.foundation import Foundation
from server.base.settings import Settings

PASSWORD = "correct horse battery"
BASE_URL = "http://127.0.0.1:8000"
AT_WILL = {"token_burst": 100_000}
"""Settings of a station whose tests may ask faster than a script may."""


class NoService:
    """Stands where the station's services are: these tests are about what they stand on."""

    def __init__(self, foundation: Foundation) -> None:
        self.foundation = foundation

    async def start(self) -> None: ...

    async def stop(self) -> None: ...


@asynccontextmanager
async def running(folder: Path, **settings: object) -> AsyncGenerator[FastAPI]:
    told = {"data_dir": folder, **AT_WILL, **settings}
    app = create_app(Settings.model_validate(told), NoService)
    async with app.router.lifespan_context(app):
        yield app


def client_of(
    app: FastAPI, *, headers: dict[str, str] | None = None, cookies: httpx.Cookies | None = None
) -> httpx.AsyncClient:
    transport = httpx.ASGITransport(app, raise_app_exceptions=False)
    return httpx.AsyncClient(
        transport=transport, base_url=BASE_URL, headers=headers, cookies=cookies
    )


@asynccontextmanager
async def admin_of(app: FastAPI) -> AsyncGenerator[httpx.AsyncClient]:
    """Set the station up as a browser does."""
    async with client_of(app) as client:
        body = {"name": "ann", "password": PASSWORD, "code": app.state.first_code}
        answer = await client.post("/api/session/first", json=body)
        assert answer.status_code == 201, answer.text
        client.headers["X-CSRF-Token"] = answer.json()["csrf_token"]
        yield client


@asynccontextmanager
async def signed_in(
    app: FastAPI, role: Role = Role.ADMIN, name: str = "ann"
) -> AsyncGenerator[httpx.AsyncClient]:
    """Come in by a bearer token, which needs no slow password."""
    headers = bearer(await token_of(app, role, name))
    async with client_of(app, headers=headers) as client:
        yield client


async def token_of(app: FastAPI, role: Role, name: str = "script", **lifetime: float) -> str:
    foundation: Foundation = app.state.foundation
    lasting = timedelta(**(lifetime or {"days": 1}))

    def write(session: Session) -> register.IssuedToken:
        return register.create_token(
            session, name, role, lasting, at=foundation.clock.now(), by="test"
        )

    issued = await foundation.store.write(write)
    return issued.secret


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}
