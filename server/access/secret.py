"""Secrets: made here, shown once, kept as hashes."""

import hashlib
import secrets
from typing import Annotated

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError
from pydantic import Field, SecretStr

PASSWORD_LENGTH_MIN = 10
PASSWORD_LENGTH_MAX = 1000
NewPassword = Annotated[
    SecretStr,
    Field(
        max_length=PASSWORD_LENGTH_MAX,
        json_schema_extra={"minLength": PASSWORD_LENGTH_MIN},
        description="At least ten characters.",
    ),
]
"""Of a request; ``hash_password`` looks at its length."""
_NO_PASSWORD = (
    "$argon2id$v=19$m=65536,t=3,p=4$dJdFtQNQ6TO53nCmL5iTDQ$+UH3EE"
    "zdofD/Wpgdtl07gArLBcV4RzZi8t9g4+TLSSE"
)
"""Hash of a password that was thrown away: checking against it takes as long as a real check."""
TOKEN_PREFIX = "grace_"


def new_secret() -> str:
    """Return a fresh secret of 256 bits that is safe in a URL."""
    return TOKEN_PREFIX + secrets.token_urlsafe(32)


def new_code() -> str:
    """Return a code that a person can type: 40 bits in two groups of five."""
    alphabet = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789"
    letters = "".join(secrets.choice(alphabet) for _ in range(10))
    return f"{letters[:5]}-{letters[5:]}"


def secret_hash(secret: str) -> str:
    """Return the hash by which the database knows a secret.

    A plain SHA-256 is enough because the secret is random; passwords use ``hash_password``.
    """
    return hashlib.sha256(secret.encode(errors="surrogatepass")).hexdigest()


def hash_password(password: str) -> str:
    """Return the argon2id hash of a password; slow on purpose, so run it in a thread.

    Raises:
        ValueError: If the password is too short.
    """
    if len(password) < PASSWORD_LENGTH_MIN:
        raise ValueError(f"a password has at least {PASSWORD_LENGTH_MIN} characters")
    return PasswordHasher().hash(_bytes_of(password))


def password_fits(password: str, password_hash: str | None) -> bool:
    """Tell whether a password fits a hash; without a hash it takes as long and says no."""
    hasher = PasswordHasher()
    try:
        hasher.verify(password_hash or _NO_PASSWORD, _bytes_of(password))
    except (VerificationError, InvalidHashError):
        return False
    return password_hash is not None


def _bytes_of(password: str) -> bytes:
    return password.encode(errors="surrogatepass")
