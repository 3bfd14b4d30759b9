r"""Encrypted backups: anybody's public key or a passphrase seals, only its owner opens.

A sealed file is a header and then chunks::

    file   = header chunk*
    header = "grace-backup 1\n" "K" recipient[32] ephemeral[32]
           | "grace-backup 1\n" "P" log2_n[1] r[1] p[1] salt[16]
    chunk  = ChaCha20-Poly1305(key, nonce, plain, associated data = header)
    nonce  = number[11, big-endian, from 0] last[1: 0 or 1]

Each chunk but the last holds 65536 bytes of plain text, the last one as much or less; each is 16
bytes longer when sealed. The number in the nonce refuses chunks that were moved, its last byte a
file that was cut off between two. The key (32 bytes) is

- *K*: HKDF-SHA256 of X25519(ephemeral, recipient), without salt, its info ``grace-backup 1``,
  ephemeral and recipient. The ephemeral key is drawn for each file and its private half forgotten:
  whoever made a backup cannot read it later.
- *P*: scrypt of the passphrase in UTF-8 (NFC).

Source:
    The construction is STREAM (Hoang, Reyhanitabar, Rogaway, Vizar, 2015), as age uses it.
"""

import io
import os
import unicodedata
from dataclasses import dataclass
from typing import Final, Self

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF
from cryptography.hazmat.primitives.kdf.scrypt import Scrypt

from server.backup.archive import ByteSink, ByteSource
from server.backup.failure import BackupError
from server.backup.key import Passphrase, PrivateKey, PublicKey

MAGIC: Final = b"grace-backup 1\n"
CHUNK_BYTES: Final = 1 << 16
_TAG_BYTES: Final = 16
_KEY_BYTES: Final = 32
_INFO: Final = b"grace-backup 1"
_SALT_BYTES: Final = 16
_SCRYPT: Final = (17, 8, 1)
"""log2 N, r, p: 128 MB and some 0.4 s."""
_SCRYPT_MAX: Final = (20, 16, 4)
"""A header that asks for more is refused: it would take all of the memory."""

Lock = PublicKey | Passphrase
"""What a backup is sealed with."""
Opener = PrivateKey | Passphrase
"""What it is opened with."""


@dataclass(frozen=True, slots=True)
class Seal:
    """Header and key of one sealed file; keep the key no longer than the file is worked on."""

    header: bytes
    key: bytes

    @classmethod
    def draw(cls, lock: Lock) -> Self:
        """Return the seal of a new file."""
        if isinstance(lock, Passphrase):
            return cls.of_passphrase(lock, bytes(_SCRYPT) + os.urandom(_SALT_BYTES))
        return cls.of_recipient(lock, X25519PrivateKey.generate())

    @classmethod
    def of_recipient(cls, recipient: PublicKey, ephemeral: X25519PrivateKey) -> Self:
        """Return the seal that the owner of a key can open."""
        mine = ephemeral.public_key().public_bytes_raw()
        shared = ephemeral.exchange(X25519PublicKey.from_public_bytes(recipient.raw))
        return cls(MAGIC + b"K" + recipient.raw + mine, _derived(shared, mine, recipient.raw))

    @classmethod
    def of_passphrase(cls, passphrase: Passphrase, cost_and_salt: bytes) -> Self:
        """Return the seal that whoever knows the passphrase can open.

        Args:
            passphrase: What is known.
            cost_and_salt: log2 N, r and p of scrypt, a byte each, and 16 bytes of salt.
        """
        log2_n, r, p = cost_and_salt[:3]
        kdf = Scrypt(salt=cost_and_salt[3:], length=_KEY_BYTES, n=1 << log2_n, r=r, p=p)
        text = unicodedata.normalize("NFC", passphrase.text).encode()
        return cls(MAGIC + b"P" + cost_and_salt, kdf.derive(text))

    @classmethod
    def read(cls, source: ByteSource, opener: Opener | None, shown: object) -> Self:
        """Read the header of a sealed file, of which ``MAGIC`` was read.

        Raises:
            BackupError: If it is opened by something else, or damaged.
        """
        kind = source.read(1)
        if kind == b"K":
            return cls._read_recipient(source.read(2 * _KEY_BYTES), opener, shown)
        if kind == b"P":
            return cls._read_passphrase(source.read(len(_SCRYPT) + _SALT_BYTES), opener, shown)
        raise _damaged(shown)

    @classmethod
    def _read_recipient(cls, rest: bytes, opener: Opener | None, shown: object) -> Self:
        if len(rest) != 2 * _KEY_BYTES:
            raise _damaged(shown)
        recipient, ephemeral = PublicKey(rest[:_KEY_BYTES]), rest[_KEY_BYTES:]
        if not isinstance(opener, PrivateKey):
            raise BackupError(
                f"{shown} is encrypted for the key {recipient.fingerprint}; give the file of that "
                "key with --key."
            )
        if opener.public != recipient:
            raise BackupError(
                f"{shown} is encrypted for the key {recipient.fingerprint}; the key that was given "
                f"is {opener.public.fingerprint}."
            )
        try:
            shared = X25519PrivateKey.from_private_bytes(opener.raw).exchange(
                X25519PublicKey.from_public_bytes(ephemeral)
            )
        except ValueError as error:  # a point of small order, which no maker draws
            raise _damaged(shown) from error
        return cls(MAGIC + b"K" + rest, _derived(shared, ephemeral, recipient.raw))

    @classmethod
    def _read_passphrase(cls, rest: bytes, opener: Opener | None, shown: object) -> Self:
        if len(rest) != len(_SCRYPT) + _SALT_BYTES:
            raise _damaged(shown)
        if any(not 1 <= one <= most for one, most in zip(rest, _SCRYPT_MAX, strict=False)):
            raise _damaged(shown)
        if not isinstance(opener, Passphrase):
            raise BackupError(
                f"{shown} is encrypted by a passphrase; give a file that holds it with "
                "--passphrase-file."
            )
        return cls.of_passphrase(opener, rest)


class Sealing(io.RawIOBase):
    """Seals what is written to it; closing it writes the last chunk, and leaves the sink open."""

    def __init__(self, sink: ByteSink, seal: Seal) -> None:
        super().__init__()
        self._sink, self._header = sink, seal.header
        self._cipher = ChaCha20Poly1305(seal.key)
        self._number = 0
        self._waiting = bytearray()
        sink.write(seal.header)

    def writable(self) -> bool:
        """Say that it takes bytes."""
        return True

    def write(self, data: "bytes | bytearray | memoryview", /) -> int:  # type: ignore[override]
        """Take bytes. A full chunk waits for more, for only then it is not the last."""
        self._waiting += data
        while len(self._waiting) > CHUNK_BYTES:
            self._put(bytes(self._waiting[:CHUNK_BYTES]), is_last=False)
            del self._waiting[:CHUNK_BYTES]
        return len(data)

    def close(self) -> None:
        """Write the last chunk."""
        if not self.closed:
            self._put(bytes(self._waiting), is_last=True)
        super().close()

    def _put(self, plain: bytes, *, is_last: bool) -> None:
        nonce = _nonce(self._number, is_last=is_last)
        self._sink.write(self._cipher.encrypt(nonce, plain, self._header))
        self._number += 1


class Unsealing(io.RawIOBase):
    """Opens a sealed file, of which the header was read; what it gives was proved authentic.

    ``read`` raises ``BackupError`` at the first chunk that is not what was sealed, or not there.
    """

    def __init__(self, source: ByteSource, seal: Seal, shown: object) -> None:
        super().__init__()
        self._source, self._header, self._shown = source, seal.header, shown
        self._is_of_key = seal.header[len(MAGIC) :][:1] == b"K"
        self._cipher = ChaCha20Poly1305(seal.key)
        self._number = 0
        self._next = source.read(CHUNK_BYTES + _TAG_BYTES)
        self._plain = b""
        self._is_over = False

    def readable(self) -> bool:
        """Say that it gives bytes."""
        return True

    def read(self, size: int = -1, /) -> bytes:
        """Return the next bytes, as many as asked for unless the end is reached."""
        parts: list[bytes] = []
        wanted = size
        while wanted and (self._plain or self._fill()):
            part = self._plain if wanted < 0 else self._plain[:wanted]
            self._plain = self._plain[len(part) :]
            parts.append(part)
            wanted -= len(part) if wanted > 0 else 0
        return b"".join(parts)

    def _fill(self) -> bool:
        """Open the next chunk; tell whether there was one with anything in it."""
        if self._is_over:
            return False
        sealed, self._next = self._next, self._source.read(CHUNK_BYTES + _TAG_BYTES)
        self._is_over = not self._next
        try:
            nonce = _nonce(self._number, is_last=self._is_over)
            self._plain = self._cipher.decrypt(nonce, sealed, self._header)
        except InvalidTag as error:
            raise self._refusal(sealed) from error
        self._number += 1
        return bool(self._plain)

    def _refusal(self, sealed: bytes) -> BackupError:
        if not sealed or (self._is_over and self._is_whole(sealed)):
            return BackupError(f"{self._shown} is cut off: its end is missing.")
        if self._number == 0 and not self._is_of_key:
            return BackupError(
                f"{self._shown} cannot be opened: the passphrase is another one, or the file is "
                "damaged."
            )
        return _damaged(self._shown)

    def _is_whole(self, sealed: bytes) -> bool:
        """Tell whether a chunk at the end is one from before the end."""
        try:
            self._cipher.decrypt(_nonce(self._number, is_last=False), sealed, self._header)
        except InvalidTag:
            return False
        return True


def _derived(shared: bytes, ephemeral: bytes, recipient: bytes) -> bytes:
    info = _INFO + ephemeral + recipient
    return HKDF(algorithm=SHA256(), length=_KEY_BYTES, salt=None, info=info).derive(shared)


def _nonce(number: int, *, is_last: bool) -> bytes:
    return number.to_bytes(11, "big") + bytes([is_last])


def _damaged(shown: object) -> BackupError:
    return BackupError(f"{shown} is damaged or was changed: it is not what was sealed.")
