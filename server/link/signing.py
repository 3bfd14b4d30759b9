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
from server.base.secret import SecretStore, SecretUnreadableError, secret_fault

_log = logging.getLogger(__name__)


class RobotSigning:
    """Hands out one ``Signing`` a robot, so that its stamps go on when its links change."""

    def __init__(self, secrets: SecretStore, clock: Clock) -> None:
        self._secrets = secrets
        self._clock = clock
        self._known: dict[RobotId, Signing] = {}
        self._decisions: dict[RobotId, int] = defaultdict(int)

    def decisions(self, robot: RobotId) -> int:
        """Return how often it was decided anew, or is to be looked at again, how a robot signs."""
        return self._decisions[robot]

    def decide_anew(self, robot: RobotId) -> None:
        """Look again how a robot signs: its key was made or ended."""
        self._decisions[robot] += 1
        self._known.pop(robot, None)

    def settle(self) -> None:
        """Keep exactly which frames were taken, where no more are heard. It writes to the disk."""
        for signing in self._known.values():
            signing.settle()

    def __call__(self, robot: RobotId) -> Signing | None:
        """Return how frames of a robot are signed; ``None`` where it has no signing key.

        A robot whose key cannot be read gets one that nobody holds: it is neither believed
        unsigned nor a reason for the others to go without radio. Where it is the disk that fails,
        the key is looked for again as soon as the fleet is looked through again.
        """
        signing = self._known.get(robot)
        if signing is not None:
            return signing
        try:
            signing = self._made(robot)
        except SecretUnreadableError as error:
            self._tell(robot, error)
            signing = self._nobodys("its signing key cannot be read; make a new one")
        except OSError as error:
            self._tell(robot, error)
            self._decisions[robot] += 1
            return self._nobodys(f"its signing key cannot be read now: {secret_fault(error)}")
        if signing is not None:
            self._known[robot] = signing
        return signing

    def _made(self, robot: RobotId) -> Signing | None:
        key = self._secrets.signing_key(robot)
        if key is None:
            return None
        return Signing(key, FileSigningMemory(self._secrets.signing_marks(robot)), self._clock)

    def _nobodys(self, fault: str) -> Signing:
        signing = Signing(secrets.token_bytes(SECRET_BYTES), MemorySigningMemory(), self._clock)
        signing.fault = fault
        return signing

    def _tell(self, robot: RobotId, error: SecretUnreadableError | OSError) -> None:
        text = "%s has no radio until its signing key is put right: %s"
        _log.error(text, robot, secret_fault(error))
