"""Keys of encrypted backups: a public one for the station, a private one for its administrator."""

import os
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Final, Self

from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey

from robot_link.whole_file import keep_names
from server.backup.failure import BackupError

PUBLIC: Final = "grace-backup-public-"
PRIVATE: Final = "grace-backup-private-"
KEY_LENGTH: Final = len(PUBLIC) + 64
_BYTES: Final = 32
_FILE: Final = """\
# The key of encrypted backups of a Grace station. Whoever has it can read them; without it nobody
# can. Keep it away from the station, in two places.
{public}
{private}
"""


@dataclass(frozen=True, slots=True)
class PublicKey:
    """What backups are encrypted with; no secret."""

    raw: bytes

    @property
    def text(self) -> str:
        """As people copy it."""
        return PUBLIC + self.raw.hex()

    @property
    def fingerprint(self) -> str:
        """As people compare it."""
        digits = sha256(self.raw).hexdigest()[:16]
        return "-".join(digits[at : at + 4] for at in range(0, 16, 4))

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read the form that people copy.

        Raises:
            ValueError: If it is none.
        """
        return cls(_raw(text.strip(), PUBLIC, "a public key"))


@dataclass(frozen=True, slots=True)
class PrivateKey:
    """What backups are opened with."""

    raw: bytes = field(repr=False)

    @property
    def public(self) -> PublicKey:
        """The public half."""
        key = X25519PrivateKey.from_private_bytes(self.raw)
        return PublicKey(key.public_key().public_bytes_raw())

    @classmethod
    def make(cls, file: Path) -> Self:
        """Draw a key and keep it in a new file that nobody else may read.

        Raises:
            BackupError: If there is a file, or it cannot be written.
        """
        key = cls(X25519PrivateKey.generate().private_bytes_raw())
        content = _FILE.format(public=key.public.text, private=PRIVATE + key.raw.hex())
        try:
            descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with open(descriptor, "w", encoding="ascii") as handle:
                handle.write(content)
                handle.flush()
                os.fsync(handle.fileno())
            keep_names(file.absolute().parent)
        except OSError as error:
            raise BackupError(f"{file} cannot be written: {error.strerror or error}.") from error
        return key

    @classmethod
    def load(cls, file: Path) -> Self:
        """Read a file that ``make`` wrote.

        Raises:
            BackupError: If it cannot be read, or holds no private key.
        """
        for line in _lines(file):
            if line.startswith(PRIVATE):
                try:
                    return cls(_raw(line, PRIVATE, "a private key"))
                except ValueError as error:
                    raise BackupError(f"{file}: {error}.") from error
        raise BackupError(f"{file} holds no private key of backups; see `grace db backup-key`.")


@dataclass(frozen=True, slots=True)
class Passphrase:
    """What a person knows."""

    text: str = field(repr=False)

    @classmethod
    def load(cls, file: Path) -> Self:
        """Read the first line of a file.

        Raises:
            BackupError: If it cannot be read, or the line is empty.
        """
        lines = _lines(file)
        if not lines or not lines[0]:
            raise BackupError(f"{file} holds no passphrase in its first line.")
        return cls(lines[0])


def _lines(file: Path) -> list[str]:
    try:
        return [line.strip() for line in file.read_text(encoding="utf-8").splitlines()]
    except UnicodeDecodeError as error:
        raise BackupError(f"{file} holds no text.") from error
    except OSError as error:
        raise BackupError(f"{file} cannot be read: {error.strerror or error}.") from error


def _raw(text: str, begins: str, title: str) -> bytes:
    try:
        raw = bytes.fromhex(text.removeprefix(begins))
    except ValueError:
        raw = b""
    if not text.startswith(begins) or len(raw) != _BYTES:
        raise ValueError(f"{title} is {begins} and {2 * _BYTES} hexadecimal digits")
    return raw
