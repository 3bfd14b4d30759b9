"""What the network knows of one modem."""

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime

from simulator.iridium.acceptance import Reason, RefusedError
from simulator.iridium.memory import LineMemory
from simulator.iridium.message_queue import MessageQueue
from simulator.iridium.session import MobileOriginatedMessage
from simulator.iridium.subscriber import Subscriber, credit_count

MAX_MOBILE_TERMINATED = 270
"""Bytes of one message to a 9602 modem."""
SEQUENCE = 65536
"""Message numbers have 16 bits."""
OUTGOING_CAPACITY = 10_000
"""Of messages that no customer takes, the newest are kept."""


@dataclass(slots=True)
class Line:
    """One modem's queue, numbers and bill."""

    subscriber: Subscriber
    queue: MessageQueue = field(default_factory=MessageQueue)
    momsn: int = 0
    mtmsn: int = 0
    credits_charged: int = 0
    mobile_originated_credits: int = 0
    outgoing: dict[int, MobileOriginatedMessage] = field(
        default_factory=dict[int, MobileOriginatedMessage]
    )
    """Messages that the customer has not taken yet, by their numbers."""
    is_in_session: bool = False
    ring_callbacks: list[Callable[[], None]] = field(default_factory=list[Callable[[], None]])
    last_ready_at: datetime | None = None

    def price_of(self, data: bytes, mtmsn: int | None) -> int:
        """Return the credits that a message to the modem needs.

        Raises:
            RefusedError: If the network does not take it.
        """
        subscriber = self.subscriber
        credits_needed = credit_count(len(data))
        credits_left = subscriber.account.credits_left
        refusals = (
            (not subscriber.has_line_rental, Reason.NO_LINE_RENTAL),
            (not data, Reason.EMPTY),
            (len(data) > MAX_MOBILE_TERMINATED, Reason.TOO_LONG),
            (not subscriber.is_attached, Reason.NOT_ATTACHED),
            (mtmsn is not None and not 0 < mtmsn < SEQUENCE, Reason.BAD_MTMSN),
            (credits_left is not None and credits_left < credits_needed, Reason.NO_CREDIT),
        )
        for is_so, reason in refusals:
            if is_so:
                raise RefusedError(reason)
        return credits_needed

    def charge(self, credits_needed: int) -> None:
        """Take credits off the account."""
        self.credits_charged += credits_needed
        account = self.subscriber.account
        if account.credits_left is not None:
            account.credits_left = max(0, account.credits_left - credits_needed)

    def post(self, message: MobileOriginatedMessage) -> None:
        """Keep a message of the modem until its customer has taken it."""
        self.outgoing[message.record_id] = message
        if len(self.outgoing) > OUTGOING_CAPACITY:
            del self.outgoing[next(iter(self.outgoing))]

    def memory(self) -> LineMemory:
        """Return what must not be forgotten."""
        return LineMemory(
            self.momsn,
            self.mtmsn,
            self.credits_charged,
            self.mobile_originated_credits,
            list(self.queue),
            list(self.outgoing.values()),
        )

    def remember(self, memory: LineMemory) -> None:
        """Go on from where the memory ends."""
        self.momsn, self.mtmsn = memory.momsn, memory.mtmsn
        self.charge(memory.credits_charged)
        self.mobile_originated_credits = memory.mobile_originated_credits
        for message in memory.queue:
            self.queue.put(message)
        self.outgoing = {message.record_id: message for message in memory.outgoing}
