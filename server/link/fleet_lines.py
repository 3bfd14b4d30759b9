"""Radios and acoustic modems, kept as the records of the fleet say."""

from robot_link.standard_config import StandardCommandConfig
from robot_link.station.gateway.address import is_acoustic
from robot_link.transport.opening import is_radio
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.fleet.disabled_links import DisabledLinks
from server.fleet.event import LinkSwitched, RobotChanged, SigningChanged
from server.fleet.fleet import Fleet
from server.link.event import RadiosChanged
from server.link.radios import Radios
from server.link.ranging import Ranging
from server.link.signing import RobotSigning


class FleetLines:
    """Tells radios and modems which robots there are, and what changes of them.

    Belongs to one event loop.
    """

    def __init__(
        self, foundation: Foundation, radios: Radios, ranging: Ranging, signing: RobotSigning
    ) -> None:
        self._foundation = foundation
        self._fleet = foundation.services.get(Fleet)
        self._radios, self._ranging, self._signing = radios, ranging, signing

    def subscribe(self) -> None:
        """Follow what changes."""
        bus = self._foundation.bus
        bus.subscribe(RobotChanged, self._robot_changed)
        bus.subscribe(SettingsChanged, self._settings_changed)
        bus.subscribe(SigningChanged, self._signing_changed)
        bus.subscribe(LinkSwitched, self._switch)

    async def start(self) -> None:
        """Tell what is known from the records."""
        await self._tell_orders()
        self._radios.set_robots([status.record for status in self._fleet.statuses])
        for uri in self._foundation.services.get(DisabledLinks).disabled:
            self._switch(LinkSwitched(uri, is_enabled=False))
        await self._tell_ranging()

    def _tell_radios(self) -> None:
        if self._radios.set_robots([status.record for status in self._fleet.statuses]):
            self._foundation.bus.publish(RadiosChanged())

    async def _tell_ranging(self) -> None:
        await self._ranging.set_robots([status.record for status in self._fleet.statuses])

    async def _tell_orders(self) -> None:
        """Say how each foreign robot takes standard commands."""
        for status in self._fleet.statuses:
            if status.record.is_foreign:
                robot = status.record.id
                found = await self._foundation.configurations.current("standard_commands", robot)
                self._radios.set_orders(robot, found.value_as(StandardCommandConfig))

    async def _follow_orders(self) -> None:
        await self._tell_orders()
        self._tell_radios()

    def _robot_changed(self, _: RobotChanged) -> None:
        self._tell_radios()
        self._foundation.background.start("acoustic modems of the fleet", self._tell_ranging())

    def _settings_changed(self, event: SettingsChanged) -> None:
        if event.kind == "standard_commands":
            self._foundation.background.start("orders to MAVLink vehicles", self._follow_orders())

    def _signing_changed(self, event: SigningChanged) -> None:
        self._signing.decide_anew(event.robot)
        self._tell_radios()

    def _switch(self, event: LinkSwitched) -> None:
        if is_radio(event.uri):
            self._radios.set_enabled(event.uri, is_enabled=event.is_enabled)
        if is_acoustic(event.uri):
            self._ranging.set_enabled(event.uri, is_enabled=event.is_enabled)
