"""The web application of one station."""

from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from importlib.metadata import version

from fastapi import FastAPI

from server.access import people_route as people
from server.access import session_route as session
from server.alarm import route as alarms
from server.base.middleware import RequestGuard
from server.base.problem import ProblemDetails, install_problem_handlers
from server.base.settings import Settings
from server.command import route as commands
from server.composition import MakeService, run_station
from server.fleet import route as robots
from server.link import onboard_route as onboard
from server.link import range_route as ranges
from server.link import route as links
from server.map import route as maps
from server.plan import route as plans
from server.recording import deployment_route as deployments
from server.recording import import_route as imports
from server.recording import journal_route as journal
from server.satellite import gateway_route as gateways
from server.scene import route as view
from server.station import Station
from server.study import identification_route as identifications
from server.study import trim_route as trim
from server.study import whatif_route as whatifs
from server.survey import mission_route as missions
from server.survey import route as surveys
from server.system import configuration_route as config
from server.system import docs_route as docs
from server.system import event_route as events
from server.system import health_route as health
from server.system import job_route as jobs
from server.system import live_route as live
from server.target import route as tracking
from server.transfer import route as transfers
from server.vehicle import coefficients_route as coefficients
from server.vehicle import route as vehicles
from webui.static import mount_app

ROUTERS = (
    health.router,
    gateways.router,
    session.router,
    people.router,
    robots.router,
    ranges.router,
    tracking.router,
    links.router,
    commands.router,
    missions.router,
    surveys.router,
    plans.router,
    transfers.router,
    onboard.router,
    maps.router,
    vehicles.router,
    coefficients.router,
    whatifs.router,
    identifications.router,
    trim.router,
    config.router,
    events.router,
    alarms.router,
    jobs.router,
    journal.router,
    imports.router,
    deployments.router,
    live.router,
    view.router,
    docs.router,
)


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
    mount_app(app)
    return app
