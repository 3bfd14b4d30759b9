"""A station to import into: new, without robots, and a pilot at it."""

import shutil
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from tests.server.conftest import DATABASE
from tests.server.station_app import running, signed_in

WHOLE = {"station", "folder"}
"""Fixtures that run a whole station, whose robots are known."""


@pytest.fixture(autouse=True)
def _known_fleet(request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """No robots are known before a test adds its own, but where it asks for a whole station."""
    if WHOLE & set(request.fixturenames):
        shutil.copy(request.getfixturevalue("prepared_database"), tmp_path / DATABASE)


@pytest.fixture
async def app(tmp_path: Path) -> AsyncIterator[FastAPI]:
    """A new station without its services."""
    async with running(tmp_path) as app:
        yield app


@pytest.fixture
async def pilot(app: FastAPI) -> AsyncIterator[httpx.AsyncClient]:
    """A client that may do everything there."""
    async with signed_in(app) as client:
        yield client
