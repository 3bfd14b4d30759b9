"""The signed word in a link that acknowledges what a notice told of.

It names the notice, which is one person's, and when it expires, and is signed by a key of the
station. That it is used once is the notice's row to know. The station keeps no copy of it.
"""

import base64
import hashlib
import hmac
from datetime import UTC, datetime
from typing import Final

_SIGNATURE_LENGTH: Final = 32
"""Characters of base64: 192 bits."""
_WORD_LENGTH_MAX: Final = 80


def link_word(key: bytes, notice: str, expires_at: datetime) -> str:
    """Return the word of a notice's link."""
    number, moment = notice.rpartition("-")[2], int(expires_at.timestamp())
    return f"{number}.{moment}.{_signature(key, number, str(moment))}"


def read_word(key: bytes, word: str) -> tuple[str, datetime] | None:
    """Return notice and expiry of a word that this station signed, else None."""
    parts = word.split(".") if len(word) <= _WORD_LENGTH_MAX and word.isascii() else []
    if len(parts) != 3 or not (parts[0].isdigit() and parts[1].isdigit()):
        return None
    number, moment, signature = parts
    if not hmac.compare_digest(signature, _signature(key, number, moment)):
        return None
    return f"notice-{number}", datetime.fromtimestamp(int(moment), UTC)


def _signature(key: bytes, number: str, moment: str) -> str:
    told = f"acknowledge notice {number} until {moment}".encode()
    digest = hmac.new(key, told, hashlib.sha256).digest()
    return base64.urlsafe_b64encode(digest).decode()[:_SIGNATURE_LENGTH]
