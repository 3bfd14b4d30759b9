"""Which samples to send when only few can be sent: those that change the map most."""

from collections.abc import Sequence

from robot_link.messages import Sample
from robot_link.onboard_settings import DigestSettings


def choose(
    samples: Sequence[Sample], settings: DigestSettings | None, max_bytes: int
) -> tuple[Sample, ...]:
    """Return the samples to send, the one that changes the map most first.

    Args:
        samples: What the station does not have yet.
        settings: Kernel and noise by fidelity; without them samples are spread in space.
        max_bytes: Bytes that they may take in a record.
    """
    raise NotImplementedError
