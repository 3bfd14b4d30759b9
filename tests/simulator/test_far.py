"""A robot out of radio range, from the gateway's door ashore to the plan on board and back."""

import asyncio
import math
from collections.abc import Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from urllib.parse import urlencode

import pytest
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from autonomy.control.config import BacksteppingConfig
from autonomy.field.config import FIELD_PRESETS
from autonomy.planner.leg import primitive
from onboard.memory import FilePlanStore
from robot_link.messages import CommandKind, CommandNumber, OnboardPlanState
from robot_link.mission import Mission, MissionSettings
from robot_link.onboard_settings import OnboardSettings
from robot_link.satellite.blob import Blob
from robot_link.satellite.chunk import cut
from robot_link.satellite.content import MobileOriginatedContent, TransferState
from robot_link.satellite.order import pack_order
from robot_link.satellite.record import read_mobile_originated
from robot_link.station.gateway.gateway import MobileOriginated
from robot_link.station.gateway.rockblock import RockBlockGateway, read_push
from simulator.fleet import GRACE_1
from simulator.iridium.http_server import Answer, Request, http_server
from simulator.process import serve
from simulator.settings import GatewaySettings, SimulatorSettings
from tests.free_port import free_port
from tests.robot_link import signed_push
from tests.robot_link.rig import until
from tests.simulator.flight import LAKE_PLANNER

SPEED = 50.0
KEY = bytes(range(32))
NAME, SYSTEM, IMEI = GRACE_1.robot, GRACE_1.system_id, GRACE_1.imei


@pytest.fixture(scope="module", name="private_key")
def _private_key():
    return signed_push.private_key()


@dataclass
class Ashore:
    """A customer of the gateway: what it was pushed, and how it sends."""

    settings: SimulatorSettings
    public_key: object
    pushed: list[MobileOriginated] = field(default_factory=list)
    counter: int = 1
    sent: int = 0

    def respond(self, request: Request) -> Answer:
        body = urlencode(request.fields).encode()
        form = "application/x-www-form-urlencoded"
        at = self.settings.clock().now()
        self.pushed.append(read_push(body, form, self.public_key, arrived_at=at))
        return Answer("OK")

    @property
    def records(self) -> list[MobileOriginatedContent]:
        return [
            read_mobile_originated(one.data, KEY, SYSTEM, NAME, one.arrived_at)
            for one in self.pushed
            if one.data
        ]

    def states_of(self, transfer_id: int) -> list[TransferState]:
        acks = [ack for record in self.records for ack in record.acks]
        return [ack.state for ack in acks if ack.transfer_id == transfer_id]

    def plan_states(self, plan: Mission) -> list[OnboardPlanState]:
        digits = plan.sha256()[:16]
        plans = [record.plan for record in self.records if record.plan is not None]
        return [said.state for said in plans if said.digits == digits]

    async def send(self, *messages: bytes) -> None:
        gateway = self.settings.gateway
        client = RockBlockGateway(
            f"http://127.0.0.1:{gateway.port}/rockblock/MT", gateway.username, gateway.password
        )
        try:
            for message in messages:
                self.sent += 1
                taken = await client.send(IMEI, message, client_id=self.sent)
                assert taken.message_id
        finally:
            await client.close()

    def chunks(self, plan: Mission, *, start: bool) -> tuple[tuple[bytes, ...], int]:
        blob = Blob.of(plan)
        self.counter += 1
        messages = cut(blob, KEY, SYSTEM, self.counter, start=start, ack_seen=False)
        return messages, blob.transfer_id


def settings_in(folder: Path, private_key, push_url: str, **changes) -> SimulatorSettings:
    now = datetime.now(UTC)
    pem = private_key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode()
    memory = folder / "robots"
    (memory / NAME).mkdir(parents=True, exist_ok=True)
    (memory / NAME / "robot.key").write_text(KEY.hex())
    chosen = {"satellite_loss": 0.0, "satellite_duplication": 0.0, "is_far": True, **changes}
    return SimulatorSettings(
        link_folder=folder / "links",
        wall_anchor=now,
        time_anchor=now,
        speed=SPEED,
        robots=(NAME,),
        memory_folder=memory,
        gateway=GatewaySettings(
            port=free_port(),
            push_url=push_url,
            username="demo",
            password="word",
            private_key_pem=pem,
        ),
        **chosen,
    )


@asynccontextmanager
async def customer(folder: Path, private_key, **changes):
    """A gateway's customer with its settings; the simulator does not run yet."""
    box: list[Ashore] = []

    def respond(request: Request) -> Answer:
        return box[0].respond(request)

    async with http_server(respond, "127.0.0.1") as url:
        chosen = settings_in(folder, private_key, url + "/push", **changes)
        box.append(Ashore(chosen, private_key.public_key()))
        yield box[0]


@asynccontextmanager
async def simulation(chosen: SimulatorSettings):
    (chosen.link_folder).mkdir(exist_ok=True)
    stopped = asyncio.Event()
    async with asyncio.TaskGroup() as group:
        task = group.create_task(serve(chosen, stopped))
        await until(lambda: task.done() or chosen.device_path(NAME, "nodes.json").exists())
        try:
            yield
        finally:
            stopped.set()


def lake_plan(*, onboard: bool = True, legs: int = 6) -> Mission:
    """Down and up where the far robot is, as many legs as asked."""
    north, east = GRACE_1.far_ne_m
    angles = [2.399963 * n for n in range(legs + 1)]
    points = [
        (north + 20.0 * math.sin(a), east + 20.0 * math.sin(1.7 * a), (6.0 + math.cos(a)) * (n % 2))
        for n, a in enumerate(angles)
    ]
    flown = [primitive.glide(LAKE_PLANNER, a, b) for a, b in pairwise(points)]
    gains = BacksteppingConfig(k_z=0.07)
    settings = OnboardSettings.of(
        "controller.backstepping", gains, LAKE_PLANNER, FIELD_PRESETS["chlorophyll"]
    )
    return Mission.from_legs(
        MissionSettings(5.0, 30.0, 5000.0, north, east),
        tuple(flown),
        onboard=settings if onboard else None,
    )


async def test_far_robot_calls_by_itself_and_says_where_it_is(tmp_path, private_key):
    async with customer(tmp_path, private_key) as ashore, simulation(ashore.settings):
        await until(lambda: len(ashore.records) > 0)
        record = ashore.records[0]
        north, east = GRACE_1.far_ne_m
        assert record.state.position_ned[0] == pytest.approx(north, abs=20.0)
        assert record.state.position_ned[1] == pytest.approx(east, abs=20.0)
        assert record.plan.state is OnboardPlanState.NONE
        assert ashore.pushed[0].latitude_deg == pytest.approx(
            GRACE_1.site.origin_latitude_deg, abs=0.2
        )


@pytest.mark.timeout(400)
async def test_plan_by_satellite_is_flown_through_loss_and_a_restart_in_the_middle(
    tmp_path, private_key
):
    """The first chunk arrives, the robot is switched off and on; the second completes the plan."""
    plan = lake_plan(legs=36)
    async with customer(tmp_path, private_key, satellite_loss=0.3, seed=4) as ashore:
        chunks, transfer = ashore.chunks(plan, start=True)
        assert len(chunks) == 2
        async with simulation(ashore.settings):
            await resent(ashore, chunks[:1], lambda: bool(ashore.states_of(transfer)))
            assert set(ashore.states_of(transfer)) == {TransferState.RECEIVING}
        async with simulation(ashore.settings):
            await resent(
                ashore, chunks[1:], lambda: TransferState.APPLIED in ashore.states_of(transfer)
            )
            await until(lambda: OnboardPlanState.RUNNING in ashore.plan_states(plan))
        on_board = FilePlanStore(ashore.settings.memory(NAME) / "plan").load()
        assert on_board.sha256() == plan.sha256()
        events = events_of(ashore)
        assert f"mission {plan.sha256()[:16]} by satellite is on board" in events
        assert "plan running" in events
        assert events.count("is on board") == 1


async def resent(ashore: Ashore, chunks, holds: Callable[[], bool]) -> None:
    """Send chunks again after each silence, as a station that hears no ack does."""
    for _ in range(100):
        await ashore.send(*chunks)
        for _ in range(30):
            if holds():
                return
            await asyncio.sleep(0.05)
    raise AssertionError(f"not heard: {ashore.records}")


def events_of(ashore: Ashore) -> str:
    files = sorted((ashore.settings.memory(NAME) / "log").glob("events-*"))
    return "".join(path.read_text() for path in files)


async def test_order_by_satellite_acts_once_and_is_answered(tmp_path, private_key):
    plan = lake_plan(onboard=False)
    async with customer(tmp_path, private_key) as ashore, simulation(ashore.settings):
        chunks, transfer = ashore.chunks(plan, start=False)
        await ashore.send(*chunks)
        await until(lambda: TransferState.APPLIED in ashore.states_of(transfer))
        await until(lambda: OnboardPlanState.ON_BOARD in ashore.plan_states(plan))
        expires = ashore.settings.clock().now() + timedelta(hours=1)
        order = pack_order(
            CommandKind.START, CommandNumber(7), expires, plan.sha256(), KEY, SYSTEM, 99
        )
        await ashore.send(order, order)

        def outcomes() -> set:
            answers = [answer for record in ashore.records for answer in record.answers]
            return {(answer.number, answer.outcome) for answer in answers}

        await until(lambda: bool(outcomes()))
        assert outcomes() == {(7, "done")}
        await until(lambda: OnboardPlanState.RUNNING in ashore.plan_states(plan))
    assert events_of(ashore).count("order start by satellite: done") == 1


async def test_message_for_another_robot_changes_nothing(tmp_path, private_key):
    plan = lake_plan()
    async with customer(tmp_path, private_key) as ashore, simulation(ashore.settings):
        foreign = cut(Blob.of(plan), bytes(32), SYSTEM, 5, start=True, ack_seen=False)
        await ashore.send(*foreign)
        await until(lambda: "the code is wrong" in events_of(ashore))
        assert not any(record.acks for record in ashore.records)
    assert FilePlanStore(ashore.settings.memory(NAME) / "plan").load() is None
