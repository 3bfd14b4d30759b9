"""Which robots sign what they say over radio, and with which key."""

import logging
import secrets
from collections import defaultdict

from robot_link.clock import Clock
from robot_link.mavlink.signing import (
    SECRET_BYTES,
    FileSigningMemory,
    MemorySigningMemory,
    Signing,
)
from robot_link.messages import RobotId
from server.base.secret import SecretStore, SecretUnreadableError

_log = logging.getLogger(__name__)


class RobotSigning:
    """Hands out one ``Signing`` a robot, so that its stamps go on when its links change."""

    def __init__(self, secrets: SecretStore, clock: Clock) -> None:
        self._secrets = secrets
        self._clock = clock
        self._known: dict[RobotId, Signing] = {}
        self._decisions: dict[RobotId, int] = defaultdict(int)

    def decisions(self, robot: RobotId) -> int:
        """Return how often it was decided anew how a robot signs, since the start."""
        return self._decisions[robot]

    def decide_anew(self, robot: RobotId) -> None:
        """Look again how a robot signs: its key was made or ended."""
        self._decisions[robot] += 1
        self._known.pop(robot, None)

    def __call__(self, robot: RobotId) -> Signing | None:
        """Return how frames of a robot are signed; ``None`` where it has no signing key.

        A robot whose key cannot be read gets one that nobody holds: it is neither believed
        unsigned nor a reason for the others to go without radio.
        """
        signing = self._known.get(robot)
        if signing is None and (found := self._made(robot)) is not None:
            signing = self._known[robot] = found
        return signing

    def _made(self, robot: RobotId) -> Signing | None:
        try:
            key = self._secrets.signing_key(robot)
            if key is None:
                return None
            memory = FileSigningMemory(self._secrets.signing_marks(robot))
            return Signing(key, memory, self._clock)
        except (SecretUnreadableError, OSError) as error:
            _log.error("%s has no radio until its signing key is put right: %s", robot, error)
            nobodys = Signing(secrets.token_bytes(SECRET_BYTES), MemorySigningMemory(), self._clock)
            nobodys.fault = "its signing key cannot be read; make a new one"
            return nobodys
