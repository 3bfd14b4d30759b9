"""The raw journal: every packet both ways, to look into and to take away."""

from collections.abc import Generator
from dataclasses import dataclass
from datetime import datetime
from itertools import islice
from typing import Annotated

from fastapi import APIRouter, Query, Response
from fastapi.responses import StreamingResponse
from pydantic import AwareDatetime
from sqlalchemy.orm import Session

from db.query.station.journal import JournalRange, iterate_frames
from db.query.storage.told import pruned_stretches
from db.record import same
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.messages import RawFrame
from server.access.caller import Caller
from server.access.dependency import Viewer
from server.base.dependency import FoundationDep, StoreDep
from server.base.problem import Problem
from server.base.view import View
from server.recording.tlog import tlog_blocks

router = APIRouter(prefix="/api", tags=["journal"])

RobotName = Annotated[str | None, Query(description="Only packets of this robot.")]
Start = Annotated[AwareDatetime | None, Query(description="First moment; RFC 3339.")]
End = Annotated[AwareDatetime | None, Query(description="Last moment; RFC 3339.")]


@dataclass(frozen=True, slots=True)
class PacketView(View):
    """One packet as it crossed a link."""

    at: datetime
    """The station's clock."""
    robot_at: datetime | None
    """Newest time that the robot wrote into it, by its own clock."""
    arrived_at: datetime | None
    """When a gateway ashore had it, where one lies in between."""
    robot: str | None
    """``null`` for what could not be attributed to a robot."""
    carrier: str
    outgoing: bool
    bytes: str
    """Hexadecimal digits."""
    messages: list[str]
    """Names of the MAVLink messages in it; empty for other wires."""


@dataclass(frozen=True, slots=True)
class JournalView(View):
    """Packets in the order in which the station had them."""

    packets: list[PacketView]
    pruned: list[str]
    """What of that time is no longer all there, sentences."""


@router.get("/journal")
async def read_journal(
    caller: Viewer,
    store: StoreDep,
    robot: RobotName = None,
    start: Start = None,
    end: End = None,
    limit: Annotated[int, Query(ge=1, le=5000)] = 200,
) -> JournalView:
    """Return the first packets from ``start`` on."""
    _refuse_all_of(caller, robot)
    wanted = JournalRange(robot, start, end)

    def read(session: Session) -> tuple[list[RawFrame], list[str]]:
        pruned = pruned_stretches(session, robot, ("raw",), start, end)
        frames = list(islice(iterate_frames(session, wanted), limit))
        return frames, [one.text for one in pruned]

    codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
    frames, pruned = await store.query(read)
    return JournalView([_packet(frame, codec) for frame in frames], pruned)


@router.get(
    "/journal.tlog",
    response_class=StreamingResponse,
    responses={200: {"content": {"application/octet-stream": {}}}},
)
async def export_tlog(
    caller: Viewer,
    store: StoreDep,
    foundation: FoundationDep,
    robot: RobotName = None,
    start: Start = None,
    end: End = None,
) -> Response:
    """Return the MAVLink packets as a telemetry log for QGroundControl, MAVProxy or MAVSDK."""
    _refuse_all_of(caller, robot)
    wanted = JournalRange(robot, start, end)
    await store.query(lambda session: next(iterate_frames(session, wanted), None))
    mark = "SIMULATION_" if foundation.settings.simulation else ""

    def blocks() -> Generator[bytes]:
        with store.read() as session:
            yield from tlog_blocks(iterate_frames(session, wanted))

    name = f"{mark}{robot or 'all'}.tlog"
    return StreamingResponse(
        blocks(),
        media_type="application/octet-stream",
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )


def _refuse_all_of(caller: Caller, robot: str | None) -> None:
    """Refuse packets of every robot, and of strangers, to whoever may see some robots alone."""
    if robot is None and not caller.rights.sees(None):
        raise Problem(403, f"Name a robot: {caller.name} may see chosen ones alone.")


def _packet(frame: RawFrame, codec: Codec) -> PacketView:
    return same(
        PacketView,
        frame,
        bytes=frame.data.hex(),
        messages=[message.get_type() for message in codec.unpack(frame.data).messages],
    )
