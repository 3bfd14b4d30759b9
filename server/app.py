"""The web application of one station."""

from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from importlib.metadata import version

from fastapi import FastAPI

from server.access.middleware import RequestGuard
from server.base.problem import ProblemDetails, install_problem_handlers
from server.base.settings import Settings
from server.document import DocumentedApp
from server.station import ROUTERS, MakeService, Station, run_station
from server.watch.request import RequestWatch
from webui.static import mount_app


def create_app(settings: Settings, make_service: MakeService = Station) -> FastAPI:
    """Build the application; the station behind it opens with the application's lifespan.

    Nothing is shared between two applications: both may run in one process.

    Args:
        settings: What the station was told from outside.
        make_service: Makes what runs on the foundation.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncGenerator[None]:
        async with run_station(settings, make_service) as running:
            app.state.foundation = running.foundation
            app.state.first_code = running.first_code
            yield

    app = DocumentedApp(
        title="Grace Ground Station",
        summary="Plan, upload, watch and map with gliding robotic fish.",
        version=version("grace-ground-station"),
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        responses={
            "4XX": {"model": ProblemDetails, "description": "Refused; `detail` says what to do."},
            "5XX": {"model": ProblemDetails, "description": "Failed; try again when it works."},
        },
    )
    install_problem_handlers(app)
    app.add_middleware(RequestGuard)
    app.add_middleware(RequestWatch)
    for router in ROUTERS:
        app.include_router(router)
    mount_app(app)
    return app
