"""The simulator's process: robots that live by the shared clock, behind emulated links."""

import asyncio
import logging
import os
import random
from collections.abc import AsyncGenerator, Callable, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from typing import TYPE_CHECKING

from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from onboard.node.body import BodyNode
from onboard.node.wire import NodeAddress
from robot_link.messages import RobotId
from robot_link.transport.opening import open_transport
from simulator.aboard import computer_of
from simulator.equipment import Timekeeping, disciplined, equipped
from simulator.fault_desk import FaultDesk, FaultTeller, only_log
from simulator.fleet import RobotDefinition, is_sub
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.rockblock_gateway import RockBlockGateway
from simulator.iridium.subscriber import Account
from simulator.life import BareBody, WholeRobot, live
from simulator.robot import SimulatedBody, SimulatedRobot
from simulator.settings import GatewaySettings, SimulatorSettings
from simulator.shard import SKY, dealt, modems, publish_sky, shards_of
from simulator.sub.endpoint import SubVehicle
from simulator.until_told import run_until_told
from simulator.xbee_network import XBeeNetwork

if TYPE_CHECKING:
    from simulator.camera.tank import EmulatedTank

_PARENT_CHECK_S = 1.0

_log = logging.getLogger(__name__)


def satellites(settings: SimulatorSettings, in_view: Callable[[str], bool]) -> IridiumNetwork:
    """Return the satellite network, which knows the modem of every robot.

    Args:
        settings: Those of the process.
        in_view: Tells whether the modem of an IMEI sees the sky now.
    """
    network = IridiumNetwork(
        random.Random(f"{settings.seed} satellites"),
        settings.satellite(),
        settings.clock(),
        in_view,
        settings.satellite_memory,
    )
    gateway = settings.gateway
    account = Account("", "") if gateway is None else Account(gateway.username, gateway.password)
    for name in settings.robots:
        imei = "" if is_sub(name) else settings.definition(name).imei
        if imei:
            network.add_subscriber(imei, account)
    return network


@asynccontextmanager
async def gateway(
    settings: GatewaySettings | None, network: IridiumNetwork
) -> AsyncGenerator[None]:
    """Open the network's gateway as long as the context lasts; without settings there is none.

    Raises:
        ValueError: If its key is no RSA key.
        OSError: If its port is taken.
    """
    if settings is None:
        yield
        return
    key = load_pem_private_key(settings.private_key_pem.encode(), password=None)
    if not isinstance(key, RSAPrivateKey):
        raise ValueError("the gateway signs with an RSA key")  # noqa: TRY004 - the text is wrong
    rockblock = RockBlockGateway(network, key, settings.push_url)
    async with rockblock.serve("127.0.0.1", settings.port) as url:
        _log.info("satellite gateway at %s", url)
        yield


def run(settings: SimulatorSettings, tell: FaultTeller = only_log) -> None:
    """Simulate until SIGTERM or SIGINT, or until the parent process is gone.

    Args:
        settings: What to simulate.
        tell: Told of each fault as it comes.

    Raises:
        ExceptionGroup: If a robot or a link failed; nothing is left running then either.
    """
    run_until_told(lambda stopped: serve(settings, stopped, tell))


async def serve(
    settings: SimulatorSettings,
    stopped: asyncio.Event,
    tell: FaultTeller = only_log,
    opened: Callable[[NodeAddress], None] = lambda _: None,
) -> None:
    """Simulate on this event loop until ``stopped`` is set, or the parent process is gone.

    Args:
        settings: What to simulate.
        stopped: Set by whoever wants it to end.
        tell: Told of each fault as it comes.
        opened: Told once where the fault desk is.

    Raises:
        ExceptionGroup: If a robot or a link failed.
    """
    bodies: dict[str, SimulatedBody] = {}  # by the number of a satellite modem
    here, away = dealt(settings)
    shards = shards_of(settings, away)

    def in_view(imei: str) -> bool:
        if imei in bodies:
            return bodies[imei].has_satellite
        return any(imei in shard.sky and shard.sky[imei].in_view for shard in shards)

    network = satellites(settings, in_view)
    desk = FaultDesk(settings.clock(), tell, (SKY,))
    async with (
        gateway(settings.gateway, network),
        desk.server.serve(NodeAddress(port=settings.desk_port or 0)) as found,
        _cameras(settings, desk) as tank,
        modems(shards, settings, network),
        asyncio.TaskGroup() as group,
    ):
        tasks: list[asyncio.Task[None]] = []

        def begin(work: Coroutine[None, None, None], name: str) -> None:
            tasks.append(group.create_task(work, name=name))

        if settings.parent_pid is not None:
            begin(_watch(settings.parent_pid, stopped), "parent watch")
        begin(desk.run(), "faults")
        if settings.has_modems_elsewhere:
            begin(publish_sky(desk.server, bodies), "sky")
        for number, shard in enumerate(shards, 1):
            begin(shard.live(desk), f"shard {number}")
        for name in here:
            if is_sub(name):
                life = _sub(settings, name, desk)
            else:
                live_as = _whole if settings.has_programs else _bare
                life = live_as(settings, settings.definition(name), network, bodies, desk, tank)
            begin(life, f"{name} life")
        opened(found)
        processes = f" in {len(shards)} more processes" if shards else ""
        robots = ", ".join(settings.robots)
        _log.info("simulating %s at speed %g%s", robots, settings.speed, processes)
        await stopped.wait()
        for task in tasks:
            task.cancel()
    _log.info("simulation ended")


@asynccontextmanager
async def _cameras(
    settings: SimulatorSettings, desk: FaultDesk
) -> AsyncGenerator["EmulatedTank | None"]:
    """Run the cameras over the tank, whose code is loaded only where there are some."""
    if not settings.cameras:
        yield None
        return
    from simulator.camera.running import emulated_cameras

    async with emulated_cameras(settings, desk) as tank:
        yield tank


async def _sub(settings: SimulatorSettings, name: RobotId, desk: FaultDesk) -> None:
    """Let a vehicle of another maker live until cancelled; stations call it by UDP."""
    transport = open_transport(f"udp://127.0.0.1:{settings.sub_port(name)}?listen=1")
    vehicle = SubVehicle(settings.sub(name), transport, settings.clock())
    desk.meet(name, vehicle)
    await vehicle.run()


async def _whole(
    settings: SimulatorSettings,
    definition: RobotDefinition,
    network: IridiumNetwork,
    bodies: dict[str, SimulatedBody],
    desk: FaultDesk,
    tank: "EmulatedTank | None",
) -> None:
    """Let a robot live with its onboard program until cancelled."""
    truth = settings.clock()
    time = Timekeeping.of(definition, settings.seed, truth)
    robot = SimulatedRobot(
        definition,
        settings.seed,
        time.started_at,
        settings.conditions(),
        stamp=lambda: time.at(robot.program.time_s),
        water_s=truth.now().timestamp(),
    )
    bodies[definition.imei] = robot.body
    desk.meet(definition.robot, robot.body)
    if tank is not None:
        tank.meet(definition.robot, robot.body, time.started_at)
    async with AsyncExitStack() as stack:
        radios = await stack.enter_async_context(_station_radio(settings, definition, robot.body))
        equipment = await stack.enter_async_context(
            equipped(settings, definition, robot.body, time, network)
        )
        await stack.enter_async_context(disciplined(time.onboard, equipment))
        camera = equipment.client("camera")
        computer = computer_of(
            definition,
            robot.program,
            radio=radios.robot_radio(definition.radio_address, definition.robot),
            clock=time.clock(),
            memory=settings.memory(definition.robot),
            satellite=equipment.client("satellite"),
            acoustic=equipment.client("acoustic"),
            tag_receiver=equipment.client("tag_receiver"),
            camera=None if camera is None else (camera, time.onboard.at),
        )
        async with asyncio.TaskGroup() as group:
            group.create_task(computer.run(), name=f"{definition.robot} computer")
            await live(WholeRobot(robot, computer), truth, time.started_at)


async def _bare(
    settings: SimulatorSettings,
    definition: RobotDefinition,
    network: IridiumNetwork,
    bodies: dict[str, SimulatedBody],
    desk: FaultDesk,
    tank: "EmulatedTank | None",
) -> None:
    """Let a robot's body and devices live until cancelled; its program runs elsewhere."""
    truth = settings.clock()
    time = Timekeeping.of(definition, settings.seed, truth)
    water_s = truth.now().timestamp()
    body = SimulatedBody(definition, settings.seed, settings.conditions(), water_s)
    node = BodyNode(body, lambda: time.oscillator.count_s(body.plant.time_s))
    bodies[definition.imei] = body
    desk.meet(definition.robot, body)
    if tank is not None:
        tank.meet(definition.robot, body, time.started_at)
    async with AsyncExitStack() as stack:
        radios = await stack.enter_async_context(_station_radio(settings, definition, body))
        line = settings.device_path(definition.robot, "radio")
        await stack.enter_async_context(radios.pty(definition.radio_address, line))
        await stack.enter_async_context(
            equipped(settings, definition, body, time, network, (node.server,))
        )
        await live(BareBody(body, node), truth, time.started_at)


@asynccontextmanager
async def _station_radio(
    settings: SimulatorSettings, definition: RobotDefinition, body: SimulatedBody
) -> AsyncGenerator[XBeeNetwork]:
    """Put the station's radio of a robot's network on a pseudo-terminal."""
    network = XBeeNetwork(
        random.Random(f"{settings.seed} {definition.robot}"),
        settings.air(),
        lambda _from, _to: body.is_in_reach,
    )
    path = settings.link_path(definition.robot)
    async with network.pty(definition.station_address, path):
        yield network


async def _watch(parent_pid: int, stopped: asyncio.Event) -> None:
    """Stop when a process is gone, or is no longer the parent that it was."""
    was_parent = os.getppid() == parent_pid
    while _is_alive(parent_pid) and (not was_parent or os.getppid() == parent_pid):
        with suppress(TimeoutError):
            async with asyncio.timeout(_PARENT_CHECK_S):
                await stopped.wait()
                return
    _log.warning("process %d is gone: the simulation ends", parent_pid)
    stopped.set()


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
