"""Puts the capability together."""

from collections import Counter
from collections.abc import Callable, Iterator

from prometheus_client.core import Metric
from sqlalchemy.orm import Session

from db.query.satellite.outbox import open_outbox
from robot_link.station.gateway.gateway import MobileOriginated
from server.access.subject import Subjects
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.base.metric.metrics import counted
from server.fleet.disabled_links import DisabledLinks
from server.fleet.event import LinkSwitched, RobotChanged, RobotReported
from server.fleet.fleet import Fleet
from server.link.ingest import Ingest
from server.satellite import gateway_route, route
from server.satellite.ending import RowsChanged
from server.satellite.gateways import GatewayChanged, Gateways, KeepMessage
from server.satellite.satellite import AccountRead, MessageArrived, OutboxChanged, Satellite

ROUTERS = (gateway_route.router, route.router)

GatewayFactory = Callable[[Foundation, KeepMessage], Gateways]


def install(foundation: Foundation, make_gateways: GatewayFactory) -> None:
    """Make what carries plans, orders and messages by satellite.

    Args:
        foundation: What the station stands on.
        make_gateways: Makes the gateways; where tests put their own.
    """
    foundation.services.get(Subjects).add_details("kind", "secret")
    services = foundation.services

    async def take(message: MobileOriginated) -> bool:
        return await satellite.take(message)

    gateways = services.add(make_gateways(foundation, take), Gateways)
    satellite = Satellite(
        foundation,
        services.get(Fleet),
        gateways,
        services.get(DisabledLinks),
        services.get(Ingest).store,
    )
    services.add(satellite)

    bus, feed = foundation.bus, foundation.feed
    bus.subscribe(LinkSwitched, lambda _: satellite.follow_switch())
    bus.subscribe(RowsChanged, satellite.rows_changed)
    bus.subscribe(SettingsChanged, satellite.settings_changed)
    bus.subscribe(RobotReported, lambda event: satellite.robot_changed(event.robot))
    bus.subscribe(RobotChanged, lambda _: satellite.stir())
    bus.subscribe(OutboxChanged, lambda event: feed.mark("satellite", event.row.robot))
    bus.subscribe(RowsChanged, lambda event: feed.mark("satellite", event.robot))
    bus.subscribe(AccountRead, lambda event: feed.mark("satellite", event.robot))
    bus.subscribe(MessageArrived, lambda event: feed.mark("satellite", event.robot))
    bus.subscribe(GatewayChanged, lambda _: feed.mark("gateways"))
    foundation.metrics.add_query(_outbox_depth)
    foundation.lifetime.on_load(satellite.load)
    foundation.lifetime.run("satellite", satellite.run)
    foundation.lifetime.on_start(gateways.start)
    foundation.lifetime.on_stop(gateways.stop)


def _outbox_depth(session: Session) -> Iterator[Metric]:
    waiting = Counter(row.robot for row in open_outbox(session))
    text = "Rows of the satellite outbox that are not delivered yet."
    yield counted("satellite_outbox_rows", text, "robot", waiting)
