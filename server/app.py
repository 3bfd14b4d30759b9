"""The web application of one station."""

import contextlib
import importlib.util
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from importlib.metadata import version

from fastapi import FastAPI

from server.api import (
    alarms,
    config,
    deployments,
    docs,
    events,
    health,
    imports,
    jobs,
    people,
    session,
)
from server.composition import MakeService, run_station
from server.middleware import RequestGuard
from server.problem import ProblemDetails, install_problem_handlers
from server.settings import Settings

ROUTERS = (
    health.router,
    session.router,
    people.router,
    config.router,
    events.router,
    alarms.router,
    jobs.router,
    imports.router,
    deployments.router,
    docs.router,
)


def create_app(settings: Settings, make_service: MakeService | None = None) -> FastAPI:
    """Build the application; the station behind it opens with the application's lifespan.

    Nothing is shared between two applications: both may run in one process.

    Args:
        settings: What the station was told from outside.
        make_service: Makes what runs on the foundation; ``Station`` where ``None``.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncGenerator[None]:
        async with run_station(settings, make_service or _interim_station()) as running:
            app.state.foundation = running.foundation
            app.state.station = running.station
            app.state.first_code = running.first_code
            yield

    app = FastAPI(
        title="Grace Ground Station",
        summary="Plan, upload, watch and map with gliding robotic fish.",
        version=version("grace-ground-station"),
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        responses={
            "4XX": {"model": ProblemDetails, "description": "Refused; `detail` says what to do."}
        },
    )
    install_problem_handlers(app)
    app.add_middleware(RequestGuard)
    for router in ROUTERS:
        app.include_router(router)
    # interim, until every part is there
    for name in ("robots", "plans", "missions", "commands", "maps", "live", "transfers", "view"):
        with contextlib.suppress(ModuleNotFoundError):
            app.include_router(importlib.import_module(f"server.api.{name}").router)
    if importlib.util.find_spec("webui.static") is not None:
        importlib.import_module("webui.static").mount_app(app)
    return app


def _interim_station() -> MakeService:
    return importlib.import_module("server.service.station").Station
