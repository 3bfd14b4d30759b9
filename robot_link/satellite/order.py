"""Orders: a command in one message that costs one credit."""

from datetime import datetime

from robot_link.messages import CommandKind, CommandNumber, PlanHash, SystemId


def pack_order(
    kind: CommandKind,
    number: CommandNumber,
    expires: datetime,
    plan: PlanHash | None,
    key: bytes,
    system: SystemId,
    counter: int,
    *,
    ack_seen: bool = False,
) -> bytes:
    """Return the message that carries a command.

    Args:
        kind: What to do.
        number: The command's number, by every carrier the same; with ``expires`` its name.
        expires: When START and RESUME are too late; whole seconds count.
        plan: Plan that START names.
        key: The robot's key.
        system: The robot's MAVLink system id.
        counter: Newer than of every transfer and order before (``ground.next_counter``).
        ack_seen: The station has seen the final word on every transfer and order before.
    """
    raise NotImplementedError
