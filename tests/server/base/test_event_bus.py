import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import pytest
from sqlalchemy.orm import Session

from db.query.station.events import add_event, newest_events
from db.store import Store
from server.base.event_bus import EventBus


@dataclass(frozen=True, slots=True)
class Heard:
    robot: str


@dataclass(frozen=True, slots=True)
class Settled:
    robot: str


def test_each_subscriber_of_the_type_is_told_in_order() -> None:
    bus, told = EventBus(), list[str]()
    bus.subscribe(Heard, lambda event: told.append(f"first {event.robot}"))
    bus.subscribe(Heard, lambda event: told.append(f"second {event.robot}"))
    bus.subscribe(Settled, lambda event: told.append(f"settled {event.robot}"))
    bus.publish(Heard("mini-1"))
    assert told == ["first mini-1", "second mini-1"]


def test_an_event_published_by_a_handler_comes_after_the_present_one() -> None:
    bus, told = EventBus(), list[str]()

    def settle(event: Heard) -> None:
        bus.publish(Settled(event.robot))
        told.append("heard first")

    bus.subscribe(Heard, settle)
    bus.subscribe(Heard, lambda _: told.append("heard second"))
    bus.subscribe(Settled, lambda _: told.append("settled"))
    bus.publish(Heard("mini-1"))
    assert told == ["heard first", "heard second", "settled"]


def test_a_handler_that_raises_keeps_nobody_from_hearing() -> None:
    bus, told, failures = EventBus(), list[str](), list[tuple[str, str]]()
    bus.on_failure = lambda name, error: failures.append((name, str(error)))

    def fail(_: Heard) -> None:
        raise ValueError("full")

    bus.subscribe(Heard, fail)
    bus.subscribe(Heard, lambda event: told.append(event.robot))
    bus.publish(Heard("mini-1"))
    assert told == ["mini-1"]
    assert failures == [("what follows Heard", "full")]


async def told_by(store: Store, bus: EventBus, write: Callable[[Session], object]) -> list[str]:
    """Return what a change told, as a station tells it."""
    loop, told = asyncio.get_running_loop(), list[str]()
    bus.subscribe(Settled, lambda event: told.append(event.robot))

    def tell(events: Sequence[object]) -> None:
        loop.call_soon_threadsafe(bus.publish, *events)

    with store.listening(tell):
        await store.write(write)
    return told


async def test_an_event_of_a_transaction_is_told_before_its_writer_goes_on(memory: Store) -> None:
    bus = EventBus()
    assert await told_by(memory, bus, lambda s: bus.write(s, Settled("mini-1"), "a")) == ["mini-1"]


async def test_the_newest_event_about_a_thing_is_the_one_that_is_told(memory: Store) -> None:
    bus = EventBus()

    def write(session: Session) -> None:
        for robot, about in (("first", "a"), ("other", "b"), ("newest", "a")):
            bus.write(session, Settled(robot), about)

    assert await told_by(memory, bus, write) == ["other", "newest"]


async def test_what_follows_is_written_with_the_event_and_both_or_neither(memory: Store) -> None:
    bus, at = EventBus(), datetime.now(UTC)

    def follow(session: Session, event: Settled) -> None:
        add_event(session, at, "test.followed", event.robot)
        if event.robot == "bad":
            raise ValueError(event.robot)

    bus.subscribe_within(Settled, follow)
    assert await told_by(memory, bus, lambda s: bus.write(s, Settled("good"), "a")) == ["good"]
    with pytest.raises(ValueError, match="bad"):
        await told_by(memory, bus, lambda s: bus.write(s, Settled("bad"), "a"))
    found = await memory.query(newest_events)
    assert [event.text for event in found if event.kind == "test.followed"] == ["good"]
