"""Which robots sign what they say over radio, and with which key."""

from robot_link.clock import Clock
from robot_link.mavlink.signing import FileSigningMemory, Signing
from robot_link.messages import RobotId
from server.secret import SecretStore


class RobotSigning:
    """Hands out one ``Signing`` a robot, so that its stamps go on when its links change."""

    def __init__(self, secrets: SecretStore, clock: Clock) -> None:
        self._secrets = secrets
        self._clock = clock
        self._known: dict[RobotId, Signing] = {}

    def __call__(self, robot: RobotId) -> Signing | None:
        """Return how frames of a robot are signed; ``None`` where it has no signing key.

        Raises:
            SecretUnreadableError: If its key or its marks are damaged.
        """
        signing = self._known.get(robot)
        if signing is None and (key := self._secrets.signing_key(robot)) is not None:
            memory = FileSigningMemory(self._secrets.signing_marks(robot))
            signing = self._known[robot] = Signing(key, memory, self._clock)
        return signing
