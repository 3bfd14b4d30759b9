"""Encrypted backups: opened by their owner alone, and refused whatever byte was changed."""

import io
import os
import stat

import pytest
from cryptography.hazmat.primitives import hashes, hmac
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from hypothesis import given, settings
from hypothesis import strategies as st

from server.backup import sealing
from server.backup.failure import BackupError
from server.backup.key import Passphrase, PrivateKey, PublicKey
from server.backup.sealing import CHUNK_BYTES, MAGIC, Seal, Sealing, Unsealing

OWNER = PrivateKey(bytes(range(32)))
EPHEMERAL = X25519PrivateKey.from_private_bytes(bytes(range(32, 64)))
PLAIN = b"Grace, " * 20_000  # 140,000 bytes: three chunks
SEALED_CHUNK = CHUNK_BYTES + 16
QUICK = Passphrase("correct horse")
QUICK_COST = bytes((4, 8, 1)) + bytes(range(16))


def sealed(plain: bytes, seal: Seal) -> bytes:
    sink = io.BytesIO()
    with Sealing(sink, seal) as file:
        file.write(plain)
    return sink.getvalue()


def opened(data: bytes, opener: PrivateKey | Passphrase | None) -> bytes:
    source = io.BytesIO(data)
    assert source.read(len(MAGIC)) == MAGIC
    return Unsealing(source, Seal.read(source, opener, "lake"), "lake").read()


def for_owner(plain: bytes = PLAIN) -> bytes:
    return sealed(plain, Seal.of_recipient(OWNER.public, EPHEMERAL))


def hkdf(secret: bytes, info: bytes) -> bytes:
    """RFC 5869 with SHA-256, no salt and 32 bytes of output, from its own text."""

    def mac(key: bytes, data: bytes) -> bytes:
        one = hmac.HMAC(key, hashes.SHA256())
        one.update(data)
        return one.finalize()

    return mac(mac(bytes(32), secret), info + b"\x01")


def test_a_sealed_file_is_what_its_description_says():
    """A second reader, written from the decision record alone."""
    data = for_owner()
    header, body = data[:80], data[80:]
    assert header[:16] == b"grace-backup 1\nK"
    recipient, ephemeral = header[16:48], header[48:]
    assert recipient == OWNER.public.raw
    shared = X25519PrivateKey.from_private_bytes(OWNER.raw).exchange(
        X25519PublicKey.from_public_bytes(ephemeral)
    )
    key = hkdf(shared, b"grace-backup 1" + ephemeral + recipient)
    chunks = [body[at : at + 65552] for at in range(0, len(body), 65552)]
    plain = b"".join(
        ChaCha20Poly1305(key).decrypt(
            number.to_bytes(11, "big") + bytes([number == len(chunks) - 1]), chunk, header
        )
        for number, chunk in enumerate(chunks)
    )
    assert (len(chunks), plain) == (3, PLAIN)


def test_files_of_this_version_stay_readable():
    """Test vectors: whoever changes the format must make a new one beside it."""
    vector = for_owner(b"Grace")
    assert vector.hex() == KEY_VECTOR
    assert opened(bytes.fromhex(KEY_VECTOR), OWNER) == b"Grace"
    assert sealed(b"Grace", Seal.of_passphrase(QUICK, QUICK_COST)).hex() == PASSPHRASE_VECTOR
    assert opened(bytes.fromhex(PASSPHRASE_VECTOR), QUICK) == b"Grace"


KEY_VECTOR = (
    "67726163652d6261636b757020310a4b8f40c5adb68f25624ae5b214ea767a6ec94d829d3d7b5e1ad1ba6f3e"
    "2138285f358072d6365880d1aeea329adf9121383851ed21a28e3b75e965d0d2cd166254935dcd282098560e"
    "0dd6f0ba69ddbbe5cab98647ca"
)
PASSPHRASE_VECTOR = (
    "67726163652d6261636b757020310a50040801000102030405060708090a0b0c0d0e0f3ce625d9924d119ca7"
    "29b9f0271a85aba9eadb169a"
)


@settings(max_examples=30)
@given(
    size=st.sampled_from([0, 1, CHUNK_BYTES - 1, CHUNK_BYTES, CHUNK_BYTES + 1, 3 * CHUNK_BYTES]),
    pieces=st.lists(st.integers(1, 2 * CHUNK_BYTES), max_size=6),
)
def test_whatever_is_sealed_in_whatever_pieces_comes_back(size, pieces):
    plain = os.urandom(size)
    sink, rest = io.BytesIO(), plain
    with Sealing(sink, Seal.draw(OWNER.public)) as file:
        for piece in pieces:
            file.write(rest[:piece])
            rest = rest[piece:]
        file.write(rest)
    assert opened(sink.getvalue(), OWNER) == plain


def test_each_file_has_a_key_of_its_own():
    first, second = (Seal.draw(OWNER.public) for _ in range(2))
    assert first.key != second.key
    assert Seal.draw(Passphrase("a")).key != Seal.draw(Passphrase("a")).key


@settings(max_examples=60)
@given(at=st.integers(0, len(for_owner()) - 1), bit=st.integers(0, 7))
def test_one_changed_bit_anywhere_is_refused(at, bit):
    data = bytearray(for_owner())
    data[at] ^= 1 << bit
    if at < len(MAGIC):
        assert data[: len(MAGIC)] != MAGIC
        return
    with pytest.raises(BackupError, match=r"damaged|encrypted for the key|by a passphrase"):
        opened(bytes(data), OWNER)


@pytest.mark.parametrize(
    ("kept", "said"),
    [
        (80, "cut off"),
        (80 + SEALED_CHUNK, "cut off"),
        (80 + 2 * SEALED_CHUNK, "cut off"),
        (80 + SEALED_CHUNK + 40_000, "damaged"),
        (60, "damaged"),
    ],
)
def test_a_file_that_was_cut_off_is_refused(kept, said):
    with pytest.raises(BackupError, match=said):
        opened(for_owner()[:kept], OWNER)


def test_chunks_that_were_moved_or_repeated_are_refused():
    data = for_owner()
    header = data[:80]
    chunks = [data[80 + at : 80 + at + SEALED_CHUNK] for at in range(0, 140_000, SEALED_CHUNK)]
    for order in ((1, 0, 2), (0, 0, 1, 2), (0, 2), (2,), (0, 1, 2, 2)):
        with pytest.raises(BackupError, match="damaged"):
            opened(header + b"".join(chunks[one] for one in order), OWNER)


def test_chunks_of_another_file_are_refused():
    mine, other = (sealed(PLAIN, Seal.draw(OWNER.public)) for _ in range(2))
    with pytest.raises(BackupError, match="damaged"):
        opened(mine[:80] + other[80:], OWNER)


def test_another_key_is_named_and_refused():
    other = PrivateKey(bytes(reversed(range(32))))
    with pytest.raises(BackupError) as refused:
        opened(for_owner(), other)
    assert OWNER.public.fingerprint in str(refused.value)
    assert other.public.fingerprint in str(refused.value)


@pytest.mark.parametrize("opener", [None, QUICK])
def test_without_its_key_a_file_says_which_one_it_needs(opener):
    with pytest.raises(BackupError, match="--key"):
        opened(for_owner(), opener)


def test_another_passphrase_is_refused():
    data = sealed(PLAIN, Seal.of_passphrase(QUICK, QUICK_COST))
    assert opened(data, Passphrase("correct horse")) == PLAIN
    with pytest.raises(BackupError, match="the passphrase is another one"):
        opened(data, Passphrase("correct hose"))
    with pytest.raises(BackupError, match="--passphrase-file"):
        opened(data, OWNER)


def test_a_header_that_asks_for_all_memory_is_refused():
    data = bytearray(sealed(b"", Seal.of_passphrase(QUICK, QUICK_COST)))
    data[len(MAGIC) + 1] = 40
    with pytest.raises(BackupError, match="damaged"):
        opened(bytes(data), QUICK)


def test_a_passphrase_costs_what_the_present_day_asks_for():
    """OWASP's least for scrypt: N = 2^17, r = 8, p = 1."""
    assert Seal.draw(Passphrase("a")).header[len(MAGIC) + 1 :][:3] == bytes((17, 8, 1))
    assert sealing.CHUNK_BYTES == 65536


def test_a_key_file_is_its_owner_s_alone_and_never_replaced(tmp_path):
    file = tmp_path / "lake.key"
    key = PrivateKey.make(file)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert PrivateKey.load(file) == key
    assert PublicKey.parse(f" {key.public.text}\n") == key.public
    assert key.raw.hex() not in repr(key)
    with pytest.raises(BackupError, match="exists"):
        PrivateKey.make(file)
    assert PrivateKey.load(file) == key


@pytest.mark.parametrize("text", ["", "grace-backup-public-12", "grace-backup-private-" + "0" * 64])
def test_what_is_no_public_key_is_refused(text):
    with pytest.raises(ValueError, match="64 hexadecimal digits"):
        PublicKey.parse(text)


def test_a_file_without_a_key_is_named(tmp_path):
    (tmp_path / "empty").write_text("# nothing\n")
    with pytest.raises(BackupError, match="holds no private key"):
        PrivateKey.load(tmp_path / "empty")
    with pytest.raises(BackupError, match="cannot be read"):
        PrivateKey.load(tmp_path / "gone")
    (tmp_path / "blank").write_text("\n")
    with pytest.raises(BackupError, match="no passphrase"):
        Passphrase.load(tmp_path / "blank")
