from dataclasses import dataclass

import pytest

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


def test_a_handler_that_raises_leaves_the_bus_usable() -> None:
    bus, told = EventBus(), list[str]()

    def fail(_: Heard) -> None:
        raise ValueError("full")

    bus.subscribe(Heard, fail)
    bus.subscribe(Settled, lambda event: told.append(event.robot))
    with pytest.raises(ValueError, match="full"):
        bus.publish(Heard("mini-1"))
    bus.publish(Settled("mini-2"))
    assert told == ["mini-2"]
