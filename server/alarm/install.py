"""Puts the capability together."""

from server.access.subject import Subjects
from server.alarm import route
from server.alarm.channel_rules import ChannelAlarms
from server.alarm.rules import watch_fleet
from server.alarm.shelf import AlarmShelf
from server.base.event_bus import AlarmChanged, ChannelsChanged
from server.base.foundation import Foundation
from server.base.wakeups import Wakeups
from server.fleet.event import RobotReported
from server.fleet.fleet import Fleet

ROUTERS = (route.router,)
REST_S = 0.25
"""Wall time between two looks at robots that report all the time."""


def install(foundation: Foundation) -> None:
    """Let every rule look at each robot whose status changed, and tell of every alarm."""
    foundation.services.get(Subjects).add_stored("alarm")
    fleet, clock = foundation.services.get(Fleet), foundation.clock
    looks = Wakeups(clock, REST_S)
    foundation.bus.subscribe(RobotReported, lambda event: looks.wake(event.robot))
    by_channel = ChannelAlarms(foundation.channels, foundation.alarms)

    def look_at_all(_: ChannelsChanged) -> None:
        for status in fleet.statuses:
            looks.wake(status.record.id)

    foundation.bus.subscribe(ChannelsChanged, look_at_all)
    foundation.lifetime.run(
        "alarm rules",
        lambda: watch_fleet(fleet, foundation.alarms, clock, looks, by_channel.judge),
    )
    shelf = AlarmShelf(foundation.alarms, clock)
    foundation.bus.subscribe(AlarmChanged, lambda event: shelf.take(event.alarm))
    foundation.lifetime.run("alarm shelf", shelf.run)
    foundation.bus.subscribe(AlarmChanged, lambda _: foundation.feed.mark("alarms"))
