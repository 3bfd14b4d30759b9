"""Puts the capability together."""

from server.access.subject import Subjects
from server.alarm import route, rule_route
from server.alarm.engine import Engine
from server.alarm.rule_book import AlarmRulesChanged, RuleBook
from server.alarm.shelf import AlarmShelf
from server.alarm.station_condition import ConditionWatch
from server.alarm.trial import Trials
from server.base.event_bus import AlarmChanged, ChannelsChanged
from server.base.foundation import Foundation
from server.base.wakeups import Wakeups
from server.fleet.event import RobotReported
from server.fleet.fleet import Fleet
from server.prediction.predictions import PredictionJudged
from server.watch.station_clock import StationClock

ROUTERS = (route.router, rule_route.router)
REST_S = 0.25
"""Wall time between two looks at robots that report all the time."""


def install(foundation: Foundation) -> None:
    """Let the rules look at each robot whose status changed, and tell of every alarm."""
    subjects = foundation.services.get(Subjects)
    subjects.add_stored("alarm")
    subjects.add_details("rule")
    subjects.add_whole("/api/alarm-rules")
    fleet, clock, bus = foundation.services.get(Fleet), foundation.clock, foundation.bus
    looks = Wakeups(clock, REST_S)
    engine = Engine(fleet, foundation.alarms, clock, looks)
    book = RuleBook(foundation.store, clock, bus, foundation.channels)
    foundation.services.add(book)
    foundation.services.add(Trials(foundation, fleet))

    def judge_anew(_: object) -> None:
        channels = foundation.channels.catalogue
        engine.set_rules(book.rules.values(), channels, book.out_of_service)

    async def load() -> None:
        await book.load()
        judge_anew(None)

    foundation.lifetime.on_load(load)
    bus.subscribe(RobotReported, lambda event: looks.wake(event.robot))
    bus.subscribe(ChannelsChanged, judge_anew)
    bus.subscribe(AlarmRulesChanged, judge_anew)
    bus.subscribe(AlarmRulesChanged, lambda _: foundation.feed.mark("alarm-rules"))
    bus.subscribe(
        PredictionJudged, lambda event: engine.take_miss(event.robot, event.ellipse_units)
    )
    condition = ConditionWatch(
        foundation.settings.data_dir,
        foundation.store,
        foundation.services.get(StationClock),
        engine.take_condition,
    )
    shelf = AlarmShelf(foundation.alarms, clock)
    bus.subscribe(AlarmChanged, lambda event: shelf.take(event.alarm))
    bus.subscribe(AlarmChanged, lambda _: foundation.feed.mark("alarms"))
    foundation.lifetime.run("alarm rules", engine.run)
    foundation.lifetime.run("condition of the station", condition.run)
    foundation.lifetime.run("alarm shelf", shelf.run)
