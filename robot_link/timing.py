"""Time-outs of both ends, in seconds of the wall."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LinkTiming:
    """What both ends of a link agree to wait for."""

    heartbeat_s: float = 1.0
    """Period of the heartbeats, both ways."""
    stale_s: float = 5.0
    """Silence after which the other side counts as out of contact."""
    submerged_s: float = 2.0
    """Silence after which a robot that said it would dive counts as submerged."""
    report_s: float = 1.0
    """Period of the link reports of a station."""
    plan_report_s: float = 2.0
    """Period of the plan reports of a robot."""
    announce_s: float = 60.0
    """Time between two pages of a robot's table of channels, beside those that are asked for."""
    answer_s: float = 1.5
    """Wait for an answer to a command, an offer or a request before it is repeated."""
    retry_s: float = 3.0
    """Time between attempts to reach a robot that does not confirm, unless it is heard before."""
    repeat_jitter_s: float = 0.05
    """Longest wait before a datagram that was not confirmed is sent again."""
    upload_s: float = 30.0
    """Longest upload, beside what every item adds."""
    upload_item_s: float = 0.5
    """What every item adds to the longest upload."""
    acknowledge_s: float = 0.02
    """How long sample acknowledgements are gathered."""
    resend_s: float = 1.0
    """Wait for the first acknowledgement of a sample; doubles with every repetition."""
    resend_limit_s: float = 16.0
    """Longest wait for the acknowledgement of a sample."""
