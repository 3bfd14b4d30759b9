"""Other ground stations on the MAVLink side: who sees, who asks, who decides."""

import asyncio
from contextlib import AsyncExitStack, asynccontextmanager
from datetime import UTC, datetime
from types import SimpleNamespace

import pytest

from onboard.link.plan_store import MemoryPlanStore
from onboard.link.robot_link import RobotLink
from onboard.link.waypoint_mission import WaypointRules
from robot_link.clock import SystemClock
from robot_link.mavlink.codec import STATION_SYSTEM
from robot_link.messages import CommandKind, LogId, RobotId, SystemId
from robot_link.report import ControlAsked, ControlReport
from robot_link.sample_log import MemorySampleLog
from robot_link.transport.opening import open_transport
from server.access.role import Role
from server.lease import ground_station
from server.link.radios import open_link
from tests.robot_link.rig import Program, running, state
from tests.server.conftest import MINI, open_station, until
from tests.server.lease.conftest import act, lease_of, person_at
from tests.server.link.test_real_peers import peer

GUEST, OTHER = SystemId(200), SystemId(201)
ROBOT = RobotId(MINI)
NAME = "ground station 200"
REQUEST = 32100
STANDS_S = 600.0
"""So long a request stands where a test does not let it end, on a machine that stands still too."""
ACCEPTED, NOT_NOW, DENIED, IN_PROGRESS = 0, 1, 2, 5


def asked(system=GUEST, *, is_request=True, stands_s=STANDS_S):
    return ControlAsked(ROBOT, system, is_request, stands_s, datetime.now(UTC))


def obeys(system, *, allowed=False):
    return ControlReport(ROBOT, SystemId(system), allowed, datetime.now(UTC))


async def asks(world, client, system=GUEST, **more):
    """Have another ground station ask, and wait for the answer that the robot gets."""

    def answers():
        return [one for one in world.control_answers + world.controls if one[1] == system]

    before = len(answers())
    world.tell(asked(system, **more))
    await until(lambda: len(answers()) > before)
    return await lease_of(client)


async def test_request_is_shown_to_who_is_in_charge_and_granted_by_them_alone(person, world):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    lease = await asks(world, ann)
    assert (lease["holder"], lease["state"]) == ("ann", "requested")
    request = lease["request"]
    assert (request["by"], request["granted_in_s"]) == (NAME, None)
    assert 0 < request["ends_in_s"] <= STANDS_S
    assert world.control_answers[-1] == (ROBOT, GUEST, True)
    assert (await act(ben, "grant", to=NAME)).status_code == 409
    assert (await act(ben, "withdraw")).status_code == 409
    granted = (await act(ann, "grant", to=NAME)).json()
    assert (granted["holder"], granted["holder_kind"]) == (NAME, "station")
    assert not granted["is_silent"]
    await until(lambda: world.controls[-1:] == [(ROBOT, GUEST, False)])
    assert (ROBOT, GUEST, False) not in world.control_answers
    refused = await ann.post(f"/api/robots/{MINI}/commands", json={"kind": "hold"})
    assert refused.status_code == 409
    assert "Ground station 200 is in charge of mini-1; take charge first." in refused.text
    surfaced = await ben.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"})
    assert surfaced.status_code == 202


async def test_refused_request_is_denied_and_the_next_ones_wait(person, world, monkeypatch):
    now_s = ground_station.monotonic_s()
    monkeypatch.setattr(ground_station, "monotonic_s", lambda: now_s)
    ann = await person("ann")
    await act(ann, "take")
    await asks(world, ann)
    await act(ann, "refuse", to=NAME)
    assert world.control_answers[-1] == (ROBOT, GUEST, False)
    for system in (GUEST, OTHER):
        lease = await asks(world, ann, system)
        assert lease["state"] == "held", "who asks again at once is not shown"
        assert world.control_answers[-1] == (ROBOT, system, False)
    monkeypatch.setattr(ground_station, "monotonic_s", lambda: now_s + ground_station.QUIET_S)
    assert (await asks(world, ann, OTHER))["request"]["by"] == "ground station 201"


async def test_request_that_nobody_answers_takes_nothing_even_from_who_is_silent(
    person, world, hours
):
    ann = await person("ann")
    await act(ann, "take")
    hours.passed_s = 7200.0
    lease = await asks(world, ann, stands_s=0.2)
    await until(lambda: world.control_answers[-1:] == [(ROBOT, GUEST, False)])
    lease = await lease_of(ann)
    assert (lease["holder"], lease["state"], lease["request"]) == ("ann", "held", None)


async def test_withdrawn_request_is_shown_no_more(person, world):
    ann = await person("ann")
    await act(ann, "take")
    await asks(world, ann)
    world.tell(asked(OTHER, is_request=False))
    world.tell(asked(is_request=False))

    async def is_over():
        return (await lease_of(ann))["state"] == "held"

    await until(is_over)


async def test_second_ground_station_is_refused_and_a_person_is_heard_before_either(person, world):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    await asks(world, ann)
    assert (await asks(world, ann, OTHER))["request"]["by"] == NAME
    assert world.control_answers[-1] == (ROBOT, OTHER, False)
    lease = (await act(ben, "request")).json()
    assert lease["request"]["by"] == "ben"
    assert world.control_answers[-1] == (ROBOT, GUEST, False)


@pytest.mark.parametrize("allows", [False, True])
async def test_robot_that_nobody_holds_is_given_only_where_its_setting_says_so(
    person, world, allows
):
    ann = await person("ann")
    if allows:
        patch = {"other_stations": True}
        answer = await ann.patch("/api/config/lease", params={"robot": MINI}, json=patch)
        assert answer.status_code == 200, answer.text
        await act(ann, "release")
        world.tell(obeys(STATION_SYSTEM))
        await until(lambda: world.controls[-1:] == [(ROBOT, STATION_SYSTEM, True)])
    lease = await asks(world, ann)
    assert lease["holder"] == (NAME if allows else "")
    if allows:
        await until(lambda: world.controls[-1:] == [(ROBOT, GUEST, False)])
    else:
        assert world.control_answers == [(ROBOT, GUEST, False)]


async def test_person_takes_a_robot_back_at_once_and_a_script_does_not(person, script, world):
    ann, ben, planner = await person("ann"), await person("ben"), await script("planner")
    await act(ann, "take")
    await asks(world, ann)
    await act(ann, "grant", to=NAME)
    world.tell(obeys(GUEST))
    order = await planner.post(f"/api/robots/{MINI}/commands", json={"kind": "hold"})
    assert order.status_code == 409
    assert (await act(planner, "take")).status_code == 409
    taken = (await act(ben, "take")).json()
    assert (taken["holder"], taken["is_mine"]) == ("ben", True)
    await until(lambda: world.controls[-1:] == [(ROBOT, STATION_SYSTEM, False)])


async def test_robot_that_does_not_obey_another_station_any_more_is_free(
    person, world, monkeypatch
):
    monkeypatch.setattr(ground_station, "_TAKES_S", 600.0)
    ann = await person("ann")
    await act(ann, "take")
    await asks(world, ann)
    await act(ann, "grant", to=NAME)
    given = len(world.controls)
    world.tell(obeys(STATION_SYSTEM))  # it has not taken it yet: it is told again
    await until(lambda: world.controls[given:].count((ROBOT, GUEST, False)))
    world.tell(obeys(GUEST))
    assert (await lease_of(ann))["holder"] == NAME
    world.tell(obeys(STATION_SYSTEM))

    async def is_free():
        return (await lease_of(ann))["state"] == "free"

    await until(is_free)
    assert "does not obey ground station 200 any more" in (await lease_of(ann))["reason"]


async def test_it_is_shown_whom_a_robot_obeys_and_that_one_does_not_tell(person, world):
    ann = await person("ann")
    assert "has not told by radio whom it obeys" in (await lease_of(ann))["by_radio"]
    for system, words in (
        (STATION_SYSTEM, "obeys this station"),
        (0, "obeys nobody"),
        (GUEST, "obeys ground station 200"),
    ):
        world.tell(obeys(system))
        assert words in (await lease_of(ann))["by_radio"]
    assert world.controls[-1:] in ([], [(ROBOT, STATION_SYSTEM, False)])


async def test_station_that_is_started_again_keeps_who_has_a_robot_and_refuses_what_stood(
    tmp_path, world
):
    async with open_station(tmp_path, world) as station, person_at(station, "ann") as ann:
        world.hear(MINI)
        await act(ann, "take")
        await asks(world, ann)
    async with open_station(tmp_path, world) as station, person_at(station, "ann") as ann:
        await until(lambda: world.control_answers[-1] == (ROBOT, GUEST, False))
        lease = await lease_of(ann)
        assert (lease["holder"], lease["request"]) == ("ann", None)
        world.tell(obeys(GUEST))  # whatever a robot says, nothing is taken from a person
        await until(lambda: world.controls[-1:] == [(ROBOT, STATION_SYSTEM, False)])
        assert (await lease_of(ann))["holder"] == "ann"


class Router(asyncio.DatagramProtocol):
    """Hands what each says to all others, as mavlink-router does."""

    def __init__(self):
        self.known = set()
        self.transport = None

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, addr):
        self.known.add(addr)
        for one in self.known - {addr}:
            self.transport.sendto(data, one)

    def error_received(self, exc):
        """Nobody listens there any more."""


@asynccontextmanager
async def lake(tmp_path):
    """A station with its real radios, a robot, and two ground stations of another maker."""
    loop = asyncio.get_running_loop()
    hub, _ = await loop.create_datagram_endpoint(Router, local_addr=("127.0.0.1", 0))
    port = hub.get_extra_info("sockname")[1]
    program, clock = Program(), SystemClock()
    robot = RobotLink(
        SystemId(7),
        open_transport(f"udp://127.0.0.1:{port}"),
        clock,
        program,
        log=MemorySampleLog(LogId(1)),
        plans=MemoryPlanStore(),
        waypoints=WaypointRules(origin_latitude_deg=43.0, origin_longitude_deg=-84.0),
    )
    robot.report_state(state(clock.now()))
    async with AsyncExitStack() as stack:
        stack.callback(hub.close)
        await stack.enter_async_context(running(robot.run))
        peers = [
            await stack.enter_async_context(peer("operator_peer", port, system, 7))
            for system in (GUEST, OTHER)
        ]
        yield SimpleNamespace(port=port, program=program, peers=peers, folder=tmp_path)


@asynccontextmanager
async def station_at(it):
    made = SimpleNamespace(make_link=open_link)
    async with open_station(it.folder, made) as station, person_at(station, "ann") as ann:
        if not station.fleet.knows("mini-2"):
            async with person_at(station, "boss", Role.ADMIN) as boss:
                body = {
                    "id": "mini-2", "name": "mini-2", "model": "miniglider", "system_id": 7,
                    "links": [f"udp://127.0.0.1:{it.port}"], "signing": False,
                    "site": station.fleet.status(MINI).record.site.model_dump(mode="json"),
                }  # fmt: skip
                added = await boss.post("/api/robots", json=body)
                assert added.status_code == 201, added.text
        yield ann


async def held_by(client, holder, state="held"):
    async def holds():
        lease = await lease_of(client, "mini-2")
        return (lease["holder"], lease["state"]) == (holder, state)

    await until(holds)


def say(peer, words):
    peer.process.stdin.write(f"{words}\n".encode())


@pytest.mark.process
@pytest.mark.timeout(300)
async def test_ground_stations_of_pymavlink_ask_for_a_robot_by_real_sockets(tmp_path):
    async with lake(tmp_path) as it:
        guest, other = it.peers
        async with station_at(it) as ann:
            await guest.said(control=STATION_SYSTEM)
            assert (await act(ann, "take", "mini-2")).status_code == 200
            say(guest, "hold")
            await guest.said(ack=193, result=DENIED)
            say(guest, "ask 60")
            await guest.said(ack=REQUEST, result=IN_PROGRESS)
            await held_by(ann, "ann", "requested")
            say(other, "ask 60")
            await other.said(ack=REQUEST, result=NOT_NOW)
            granted = await act(ann, "grant", "mini-2", to=NAME)
            assert granted.status_code == 200, granted.text
            await guest.said(ack=REQUEST, result=ACCEPTED)
            await other.said(control=GUEST)
            say(guest, "hold")
            await guest.said(ack=193, result=ACCEPTED)
            assert it.program.obeyed == [(CommandKind.HOLD, "")]
            say(other, "hold")
            await other.said(ack=193, result=DENIED)
        async with station_at(it) as ann:  # started again, it knows who has the robot
            await held_by(ann, NAME)
            say(guest, "release")
            await guest.said(ack=REQUEST, result=ACCEPTED)
            await held_by(ann, "", "free")
            await act(ann, "take", "mini-2")
            say(other, "ask 60")
            await held_by(ann, "ann", "requested")
            refused = await act(ann, "refuse", "mini-2", to="ground station 201")
            assert refused.status_code == 200
            await other.said(ack=REQUEST, result=DENIED)
            assert it.program.obeyed == [(CommandKind.HOLD, "")]


@pytest.mark.process
@pytest.mark.timeout(300)
async def test_request_that_the_station_does_not_answer_is_refused_in_time(tmp_path):
    async with lake(tmp_path) as it, station_at(it) as ann:
        guest, _ = it.peers
        await guest.said(control=STATION_SYSTEM)
        await act(ann, "take", "mini-2")
        say(guest, "ask 3")
        await guest.said(ack=REQUEST, result=IN_PROGRESS)
        heard = await guest.said(ack=REQUEST)
        assert heard["result"] in (NOT_NOW, DENIED)
        await held_by(ann, "ann")
