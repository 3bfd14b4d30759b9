"""The key pair with which an emulated gateway signs what it pushes."""

from pathlib import Path

from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey, generate_private_key
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

_BITS = 2048
_EXPONENT = 65537


def make_key() -> RSAPrivateKey:
    """Return a fresh private key."""
    return generate_private_key(public_exponent=_EXPONENT, key_size=_BITS)


def public_pem(key: RSAPrivateKey) -> str:
    """Return the public half as a customer is given it."""
    pem = key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    return pem.decode("ascii")


def write_public_key(key: RSAPrivateKey, file: Path) -> None:
    """Write the public half to a file, replacing an older one at once."""
    file.parent.mkdir(parents=True, exist_ok=True)
    fresh = file.with_name(f".{file.name}.new")
    fresh.write_text(public_pem(key), encoding="ascii")
    fresh.replace(file)
