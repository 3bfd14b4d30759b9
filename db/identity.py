"""Public ids: short, human and stable names such as ``plan-14``."""

from db.fault import UnknownIdError


def public_id(kind: str, key: int) -> str:
    """Return the id by which the world outside ``db`` knows a row."""
    return f"{kind}-{key}"


def key_of(kind: str, identity: str) -> int:
    """Return the key behind a public id.

    Raises:
        UnknownIdError: If the id is not one of this kind.
    """
    prefix, _, digits = identity.rpartition("-")
    if prefix != kind or not digits.isascii() or not digits.isdigit() or len(digits) > 18:
        raise UnknownIdError(kind, identity)
    return int(digits)
