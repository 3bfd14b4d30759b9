"""Films by REST: made as a job, listed, taken away as a file."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends
from fastapi.responses import FileResponse
from pydantic import AwareDatetime, Field

from robot_link.messages import RobotId
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.view import Body, View, one_of
from server.base.work.job_view import JobBegun, JobView, leaves
from server.replay.film.films import FilmFile, FilmResult, Films
from server.replay.film.order import Kind
from server.scene.replay_source import Clock

router = APIRouter(prefix="/api/robots/{robot}/films", tags=["replay"], route_class=IdempotentRoute)
FilmsDep = Annotated[Films, Depends(service(Films))]
_MEDIA_TYPE = "application/octet-stream"


class NewFilm(Body):
    """Which stretch of a robot's past becomes a film."""

    first: AwareDatetime
    """RFC 3339."""
    last: AwareDatetime
    """Of the same deployment as `first`."""
    clock: Clock = "measured"
    """`measured`: what happened. `received`: what the station had heard by then."""
    kind: Kind = "page"
    """`page`: a page of HTML that plays the 3D view in any browser, without a station. `viser`:
    the same for viser's player. `pictures`: numbered PNG in a ZIP, way and depth."""
    lasts_s: Annotated[int, Field(ge=5, le=120)] = 30
    """How long the film is, ten moments a second; the stretch runs so much faster."""


@dataclass(frozen=True, slots=True)
class FilmView(View):
    """A film that can be taken away."""

    id: str
    kind: Annotated[str, one_of("page", "viser", "pictures")]
    name: str
    bytes: int
    at: datetime
    expires_at: datetime
    """From then on it is gone; the data are not, and it can be made anew."""

    @classmethod
    def of(cls, film: FilmFile) -> "FilmView":
        """Return a film as it is told."""
        return cls(film.id, film.kind, film.path.name, film.bytes, film.at, film.expires_at)


@dataclass(frozen=True, slots=True)
class FilmsView(View):
    """The films of a robot, the newest first."""

    films: list[FilmView]
    job: str | None
    """Id of the job that makes one now."""


@router.get("")
async def list_films(caller: Viewer, robot: RobotId, films: FilmsDep) -> FilmsView:
    """Return the films of a robot that can be taken away."""
    del caller
    return FilmsView([FilmView.of(one) for one in await films.films(robot)], films.job(robot))


@router.post("", status_code=202, openapi_extra=leaves(FilmResult))
async def make_film(
    caller: Pilot, robot: RobotId, body: NewFilm, films: FilmsDep, begun: JobBegun
) -> JobView:
    """Make a film of a stretch of a robot's past; it changes nothing, and gives way to all else.

    422 for a stretch that has not come yet, or goes beyond its deployment. 409 while one is made.
    """
    job = await films.start(
        robot,
        (body.first, body.last),
        clock=body.clock,
        kind=body.kind,
        lasts_s=body.lasts_s,
        by=caller.name,
    )
    return await begun(job)


@router.get(
    "/{film}",
    response_class=FileResponse,
    responses={200: {"content": {_MEDIA_TYPE: {}}}},
)
async def get_film(caller: Viewer, robot: RobotId, film: str, films: FilmsDep) -> FileResponse:
    """Return a film as a file to be kept; no browser shows it as a page of the station."""
    del caller
    found = await films.film(robot, film)
    return FileResponse(found.path, media_type=_MEDIA_TYPE, filename=found.path.name)
