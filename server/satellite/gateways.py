"""The satellite gateways of one station: accounts, messages out, messages in, and what was refused.

Messages come in by two doors, the routes of ``server.satellite.gateway_route`` and the DirectIP
port; both end in ``take``. Nothing of an account but its name and address is ever told.
"""

import asyncio
import contextlib
import logging
from collections import Counter
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final, cast
from urllib.parse import urlsplit

from sqlalchemy.orm import Session

from db.fault import StoreError
from db.query.fleet.robots import list_robots
from db.query.station.events import add_event
from robot_link.clock import monotonic_s
from robot_link.station.gateway.address import cloudloop_thing, is_satellite, satellite_address
from robot_link.station.gateway.cloudloop import CloudloopGateway
from robot_link.station.gateway.directip import DirectIpGateway, Listener
from robot_link.station.gateway.gateway import (
    GatewayFault,
    GatewayRefusal,
    HeldBackError,
    MobileOriginated,
    SatelliteGateway,
    Taken,
)
from robot_link.station.gateway.rockblock import RockBlockGateway
from server.access.rate import RateLimit
from server.base.foundation import Foundation
from server.base.secret import GATEWAY_KINDS, GatewayAccount, GatewayKind, SecretUnreadableError

log = logging.getLogger(__name__)

GATEWAY_TITLES: Final[dict[GatewayKind, str]] = {
    "rockblock": "RockBLOCK",
    "directip": "DirectIP",
    "cloudloop": "Cloudloop",
}
_LISTEN_AGAIN_S: Final = 30.0
_FORGED = ("signature", "expired", "disagrees")
"""Why a push is refused that the gateway itself would never have made so."""
_TELL_AGAIN_S: Final = 600.0
"""Time between two entries in the log about refusals of one kind; every one is counted."""
_TOLD_MODEMS_MAX: Final = 1000
_DOOR: Final = "gateway:directip"
_PUSH_BURST: Final = 200
_PUSHES_PER_S: Final = 20.0
"""A gateway that comes back after an outage brings much at once; a fleet never does for long."""

KeepMessage = Callable[[MobileOriginated], Awaitable[bool]]
"""Keeps a message for good and returns whether it is new."""


@dataclass(frozen=True, slots=True)
class GatewayChanged:
    """An account was changed, a door opened or closed, or a gateway delivered something."""


@dataclass(slots=True)
class Traffic:
    """What came in from one gateway since the station started."""

    accepted: int = 0
    duplicate: int = 0
    refused: Counter[str] = field(default_factory=Counter[str])
    last_at: datetime | None = None
    """When the last message was accepted, repeated ones included."""


class Gateways:
    """Speaks with every gateway for every robot; belongs to one event loop.

    Args:
        foundation: What the station stands on.
        on_message: Keeps a message; when it raises, the gateway is asked to deliver it again.
    """

    def __init__(self, foundation: Foundation, on_message: KeepMessage) -> None:
        self._foundation = foundation
        self._on_message = on_message
        self._clients: dict[GatewayKind, tuple[GatewayAccount, SatelliteGateway]] = {}
        self._retired: list[SatelliteGateway] = []
        self._listener: Listener | None = None
        self._listening: asyncio.Task[Any] | None = None
        self._warning: asyncio.Task[Any] | None = None
        self._told: dict[tuple[str, str], float] = {}
        self._told_modems: set[str] = set()
        self.traffic: dict[GatewayKind, Traffic] = {kind: Traffic() for kind in GATEWAY_KINDS}
        self.limits = {kind: RateLimit(_PUSH_BURST, _PUSHES_PER_S) for kind in GATEWAY_KINDS}
        """How often each gateway may deliver; whoever lacks its secret path is not counted."""

    @property
    def directip_port(self) -> int | None:
        """Port on which DirectIP messages are taken now; None while nobody listens."""
        return None if self._listener is None else self._listener.port

    async def start(self) -> None:
        """Open the doors; a port that is taken is tried again until it is free."""
        if self._foundation.settings.directip_port is not None:
            self._listening = self._foundation.background.start(
                "DirectIP door", self._keep_listening()
            )

    async def stop(self) -> None:
        """Close the doors and every connection."""
        await self._stop_listening()
        for gateway in [*self._retired, *(client for _, client in self._clients.values())]:
            await gateway.close()
        self._retired.clear()
        self._clients.clear()

    async def account(self, kind: GatewayKind) -> GatewayAccount | None:
        """Return the account with a gateway, for checking pushes against its key.

        Raises:
            SecretUnreadableError: If its file is damaged.
        """
        return await asyncio.to_thread(self._foundation.secrets.gateway, kind)

    async def push_word(self, kind: GatewayKind) -> str:
        """Return the word in the URL of pushes that only the gateway knows."""
        return await asyncio.to_thread(self._foundation.secrets.push_path, kind)

    async def set_account(self, kind: GatewayKind, account: GatewayAccount) -> None:
        """Keep an account and use it from now on."""
        before = await asyncio.to_thread(_account_or_none, self._foundation, kind)
        await asyncio.to_thread(self._foundation.secrets.set_gateway, kind, account)
        confirmed = before is not None and before.confirms
        if kind == "directip" and self._listening is not None and confirmed != account.confirms:
            await self._stop_listening()
            await self.start()
        self._changed()

    async def send(
        self,
        carrier: str,
        imei: str,
        data: bytes,
        *,
        client_id: int,
        flush: bool = False,
        priority: int = 5,
    ) -> Taken:
        """Hand one message to the gateway that a robot's link names.

        Args:
            carrier: ``rockblock``, ``directip`` or ``cloudloop``.
            imei: Modem of the robot.
            data: 1..270 bytes.
            client_id: Number of this message, 1..65535; the same when it is tried again.
            flush: Throw away what waits for this modem first.
            priority: 1 (first) to 5, where the gateway knows priorities.

        Raises:
            ValueError: If the message cannot be sent at all; nothing left the station.
            GatewayRefusal: If there is no account, or the gateway says no.
            GatewayUnreachableError: If nobody knows whether it was taken.
        """
        client = await self._client(carrier)
        return await client.send(imei, data, client_id=client_id, flush=flush, priority=priority)

    async def take(self, message: MobileOriginated) -> bool:
        """Keep a robot's message; return whether it is new.

        Raises:
            HeldBackError: If messages of this robot are not taken now.
            StoreError: If it could not be kept.
        """
        traffic = self.traffic[cast("GatewayKind", message.carrier)]
        is_new = await self._on_message(message)
        traffic.last_at = message.arrived_at
        await self._attempt(self._foundation.alarms.clear(f"forged:{message.carrier}"))
        if is_new:
            traffic.accepted += 1
            await self._tell_of_stranger(message)
        else:
            traffic.duplicate += 1
        self._changed()
        return is_new

    async def refuse(self, kind: GatewayKind, reason: str, sentence: str | None = None) -> None:
        """Count a push that was refused, and tell of it in the log, though not of each."""
        self.traffic[kind].refused[reason] += 1
        self._changed()
        if reason in _FORGED:
            await self._warn_of_forgery(kind)
        now_s = monotonic_s()
        told_s = self._told.get((kind, reason))
        if sentence is None or (told_s is not None and now_s - told_s < _TELL_AGAIN_S):
            return
        self._told[kind, reason] = now_s
        text = f"A push of {GATEWAY_TITLES[kind]} was refused: {sentence}"
        await self._tell("gateway.refused", text, {"gateway": kind, "reason": reason}, "warning")

    def _changed(self) -> None:
        self._foundation.bus.publish(GatewayChanged())

    async def _client(self, carrier: str) -> SatelliteGateway:
        if carrier not in GATEWAY_TITLES:
            raise ValueError(f"{carrier!r} is no satellite gateway")
        kind = carrier
        try:
            account = await self.account(kind)
        except SecretUnreadableError as error:
            raise GatewayRefusal(GatewayFault.NO_ACCOUNT, str(error), "later") from error
        if account is None or not _is_complete(kind, account):
            raise GatewayRefusal(
                GatewayFault.NO_ACCOUNT,
                f"The station has no account with {GATEWAY_TITLES[kind]}; enter it.",
                "later",
            )
        known = self._clients.get(kind)
        if known is not None and known[0] == account:
            return known[1]
        if known is not None:
            self._retired.append(known[1])
        client = self._open(kind, account)
        self._clients[kind] = (account, client)
        return client

    def _open(self, kind: GatewayKind, account: GatewayAccount) -> SatelliteGateway:
        match kind:
            case "rockblock":
                return RockBlockGateway(account.url, account.username, account.password)
            case "cloudloop":
                return CloudloopGateway(account.url, account.password, self._thing_of)
            case "directip":
                parts = urlsplit(account.url)
                return DirectIpGateway(parts.hostname or "", parts.port or 0)

    async def _thing_of(self, imei: str) -> str | None:
        for uri in await self._satellite_links():
            if satellite_address(uri) == ("cloudloop", imei):
                return cloudloop_thing(uri)
        return None

    async def _satellite_links(self) -> list[str]:
        robots = await self._foundation.store.query(list_robots)
        return [uri for robot in robots for uri in robot.links if is_satellite(uri)]

    async def _tell_of_stranger(self, message: MobileOriginated) -> None:
        """Tell, once for a modem, that no robot is known to have it; its message is kept."""
        imei = message.imei
        if imei in self._told_modems or len(self._told_modems) >= _TOLD_MODEMS_MAX:
            return
        with contextlib.suppress(StoreError):
            if any(satellite_address(uri)[1] == imei for uri in await self._satellite_links()):
                return
            self._told_modems.add(imei)
            text = f"Modem {imei} sent a message; no robot's link names it. The message is kept."
            data = {"gateway": message.carrier, "imei": imei, "momsn": message.momsn}
            await self._tell("gateway.unknown_imei", text, data, "watch")

    async def _tell(self, kind: str, text: str, data: dict[str, Any], level: str) -> None:
        at = self._foundation.clock.now()

        def write(session: Session) -> None:
            add_event(session, at, kind, text, level=level, data=data)

        try:
            await self._foundation.store.write(write)
        except StoreError as error:
            log.warning("the log does not say that %s (%s)", text, error)

    async def _keep_listening(self) -> None:
        """Open the DirectIP port, waiting until it is free, and hold it until cancelled."""
        settings, alarms = self._foundation.settings, self._foundation.alarms
        account = await asyncio.to_thread(_account_or_none, self._foundation, "directip")
        listener = Listener(
            settings.directip_host,
            settings.directip_port or 0,
            self._take_delivery,
            self._foundation.clock,
            confirms=account is not None and account.confirms,
            allowed=settings.directip_allowed,
        )
        listener.refused = self.traffic["directip"].refused
        listener.on_stranger = self._stranger_knocked
        while True:
            try:
                await listener.start()
                break
            except OSError as error:
                what = error.strerror or type(error).__name__
                port = f"{settings.directip_host}:{settings.directip_port}"
                text = f"No DirectIP messages are taken: {port} cannot be listened on ({what})."
                await self._attempt(alarms.raise_(_DOOR, text, level="warning"))
            await asyncio.sleep(_LISTEN_AGAIN_S)
        self._listener = listener
        self._changed()
        try:
            await self._attempt(alarms.clear(_DOOR))
            await asyncio.Event().wait()
        finally:
            self._listener = None
            self._changed()
            await listener.stop()

    async def _take_delivery(self, message: MobileOriginated) -> None:
        """Take a message of the DirectIP port, at which anybody may knock."""
        if not self.limits["directip"].admits():
            self.traffic["directip"].refused["too_often"] += 1
            self._changed()
            raise HeldBackError("Messages come too often.")
        await self.take(message)

    def _stranger_knocked(self) -> None:
        """Tell that somebody delivers from outside of the networks that are allowed."""
        if self._warning is None or self._warning.done():
            warning = self._warn_of_forgery("directip")
            self._warning = self._foundation.background.start("DirectIP stranger", warning)
        self._changed()

    async def _warn_of_forgery(self, kind: GatewayKind) -> None:
        raised = self._foundation.alarms.raise_(f"forged:{kind}", _forged_text(kind))
        await self._attempt(raised)

    async def _attempt(self, work: Coroutine[Any, Any, object]) -> None:
        with contextlib.suppress(StoreError):
            await work

    async def _stop_listening(self) -> None:
        if self._listening is not None:
            self._listening.cancel()
            await asyncio.gather(self._listening, return_exceptions=True)
            self._listening = None


def _forged_text(kind: GatewayKind) -> str:
    title = GATEWAY_TITLES[kind]
    if kind == "directip":
        return (
            f"Somebody delivers messages in {title}'s name from a network that is not allowed; "
            "nothing of them is believed."
        )
    return (
        f"Somebody pushes messages in {title}'s name that it did not sign; nothing of them is "
        "believed. Is the key that is entered its own?"
    )


def _is_complete(kind: GatewayKind, account: GatewayAccount) -> bool:
    match kind:
        case "rockblock":
            return bool(account.username and account.password)
        case "cloudloop":
            return bool(account.password)
        case "directip":
            return True


def _account_or_none(foundation: Foundation, kind: GatewayKind) -> GatewayAccount | None:
    try:
        return foundation.secrets.gateway(kind)
    except SecretUnreadableError as error:
        log.warning("%s", error)
        return None
