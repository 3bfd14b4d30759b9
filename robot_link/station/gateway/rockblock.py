"""RockBLOCK: the web service of Ground Control for Iridium modems.

From a robot, the service pushes a form or JSON with ``imei, serial, momsn, transmit_time
("YY-MM-DD HH:MM:SS", UTC), iridium_latitude, iridium_longitude, iridium_cep, data`` (hex) and
``JWT``: the same fields as strings, signed RS256. The signed ones count. They carry no number of
their own, so a repeated push is told apart by the inbox alone. The service documents no time of
expiry; where a signature says one (``exp``, ``nbf``), it holds only then.

To a robot, ``imei, username, password, data`` (hex) and ``flush`` are posted; the answer is
``OK,<id>`` or ``FAILED,<code>,<text>``.

Source: docs.groundcontrol.com, RockBLOCK web services, "Receiving MO" and "Sending MT".
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from decimal import Decimal, InvalidOperation
from typing import Any, Final
from urllib.parse import parse_qsl

import jwt
from cryptography.hazmat.primitives.asymmetric.rsa import RSAPublicKey
from cryptography.hazmat.primitives.serialization import load_pem_public_key

from robot_link.station.gateway.gateway import (
    GatewayFault,
    GatewayRefusal,
    GatewayUnreachableError,
    MobileOriginated,
    Taken,
    check_message,
    is_imei,
)
from robot_link.station.gateway.http import FormPoster
from robot_link.station.gateway.push import PushRefusal, payload_fault, place_of, whole_number

CARRIER: Final = "rockblock"
_ALGORITHM: Final = "RS256"
_SMALLEST_KEY_BITS: Final = 2048
_FIELDS_MAX: Final = 40
_TIME: Final = re.compile(r"[0-9]{2}-[0-9]{2}-[0-9]{2} [0-9]{2}:[0-9]{2}:[0-9]{2}")
_NUMBERS: Final = frozenset(
    ("serial", "momsn", "iridium_latitude", "iridium_longitude", "iridium_cep")
)
_SIGNED: Final = ("imei", "momsn", "transmit_time", "data")
"""What the body must repeat; of the other fields, what stands in both must be equal."""
_CLOCK_ERROR_S: Final = 60.0
"""How far the clocks of gateway and station may be apart."""
_TEXT_MAX: Final = 120

_REFUSALS: Final[dict[str, tuple[GatewayFault, str]]] = {
    "10": (GatewayFault.LOGIN, "RockBLOCK refuses the account's name or password; enter them."),
    "11": (
        GatewayFault.UNKNOWN_IMEI,
        "RockBLOCK has no modem {imei} in this account; check the robot's link and the account.",
    ),
    "12": (GatewayFault.NO_LINE_RENTAL, "The line rental of modem {imei} is not paid."),
    "13": (GatewayFault.NO_CREDIT, "The RockBLOCK account has no credits left; buy some."),
    "14": (GatewayFault.BAD_DATA, "RockBLOCK could not read the message."),
    "15": (GatewayFault.TOO_LONG, "RockBLOCK says that the message is too long."),
    "16": (GatewayFault.EMPTY, "RockBLOCK says that the message is empty."),
}
_SYSTEM_ERROR: Final = "99"
_TOO_OFTEN: Final = 429
"""HTTP status of a service that has had enough for a while."""


def public_key_of(pem: str) -> RSAPublicKey:
    """Return the key with which pushes are signed.

    Raises:
        ValueError: If the text is no PEM of an RSA public key of at least 2048 bits.
    """
    try:
        key = load_pem_public_key(pem.encode())
    except Exception as error:
        raise ValueError("this is no public key in PEM form") from error
    if not isinstance(key, RSAPublicKey) or key.key_size < _SMALLEST_KEY_BITS:
        raise ValueError(f"RockBLOCK signs with RSA of at least {_SMALLEST_KEY_BITS} bits")
    return key


def read_push(
    body: bytes, content_type: str, public_key: RSAPublicKey, arrived_at: datetime
) -> MobileOriginated:
    """Return the message that a push brings, if its signature holds.

    Args:
        body: Form or JSON, as it came.
        content_type: The request's content type; JSON is also known by its first byte.
        public_key: Ground Control's, from the station's own configuration.
        arrived_at: Now.

    Raises:
        PushRefusal: If it is no push, is not signed by this key or no longer, or its body says
            other than what was signed.
    """
    said = _fields_of(body, content_type)
    signed = _claims_of(said.get("JWT"), public_key)
    _check_time(signed, arrived_at)
    _check_agreement(said, signed)
    imei = signed.get("imei")
    if not isinstance(imei, str) or not is_imei(imei):
        raise PushRefusal("malformed", "imei has not 15 digits.")
    data, fault = _payload(signed.get("data", ""))
    latitude_deg, longitude_deg, cep_km = place_of(
        signed.get("iridium_latitude"), signed.get("iridium_longitude"), signed.get("iridium_cep")
    )
    return MobileOriginated(
        carrier=CARRIER,
        imei=imei,
        momsn=whole_number(signed.get("momsn"), "momsn", 0xFFFF),
        mtmsn=None,
        session_at=_time_of(signed.get("transmit_time")),
        arrived_at=arrived_at,
        data=data,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        cep_km=cep_km,
        session_status=whole_number(
            signed.get("iridium_session_status", 0), "iridium_session_status", 0xFF
        ),
        fault=fault,
    )


class RockBlockGateway:
    """Sends through RockBLOCK.

    Args:
        url: Where to post, ``https://rockblock.rock7.com/rockblock/MT``.
        username: Of the account.
        password: Of the account; it travels in the body alone.
        total_s: Longest time for one message.
    """

    carrier = CARRIER

    def __init__(self, url: str, username: str, password: str, total_s: float = 15.0) -> None:
        self._username = username
        self._password = password
        self._poster = FormPoster(url, "RockBLOCK", total_s)

    async def send(
        self, imei: str, data: bytes, *, client_id: int, flush: bool = False, priority: int = 5
    ) -> Taken:
        """Hand one message over; see ``SatelliteGateway.send``."""
        check_message(imei, data, client_id, priority)
        fields = {
            "imei": imei,
            "username": self._username,
            "password": self._password,
            "data": data.hex(),
        }
        if flush:
            fields["flush"] = "yes"
        status, text = await self._poster.post(fields)
        return self._taken(imei, status, text)

    async def close(self) -> None:
        """Give connections up."""
        await self._poster.close()

    def _taken(self, imei: str, status: int, text: str) -> Taken:
        word, *rest = [part.strip() for part in text.strip().split(",", 2)]
        if word == "OK" and rest and rest[0]:
            return Taken(rest[0][:_TEXT_MAX], None, None)
        if status == _TOO_OFTEN:
            raise GatewayRefusal(
                GatewayFault.BUSY,
                "RockBLOCK takes no more at the moment; the message is tried again.",
                "later",
            )
        if word != "FAILED" or not rest:
            raise GatewayRefusal(
                GatewayFault.PROTOCOL,
                f"RockBLOCK answered what it never should (HTTP {status}); check the address.",
            )
        code = rest[0]
        if code == _SYSTEM_ERROR:
            raise GatewayUnreachableError("RockBLOCK failed at this message (its error 99).")
        if code in _REFUSALS:
            fault, sentence = _REFUSALS[code]
            raise GatewayRefusal(fault, sentence.format(imei=imei))
        raise GatewayRefusal(
            GatewayFault.OTHER, f"RockBLOCK refused the message: {self._clean(rest)}."
        )

    def _clean(self, said: Sequence[str]) -> str:
        """Return what the gateway said, short, printable and without the account's secrets."""
        text = " ".join(said)
        for secret in (self._password, self._username):
            text = text.replace(secret, "...") if secret else text
        return "".join(c for c in text if c.isprintable())[:_TEXT_MAX].rstrip(". ")


def _fields_of(body: bytes, content_type: str) -> dict[str, Any]:
    try:
        text = body.decode("utf-8")
        if "json" in content_type.lower() or text.lstrip()[:1] == "{":
            return _json_fields(text)
        return _unique(
            parse_qsl(text, keep_blank_values=True, max_num_fields=_FIELDS_MAX, errors="strict")
        )
    except (ValueError, RecursionError):
        raise PushRefusal("malformed", "This is no push of RockBLOCK.") from None


def _json_fields(text: str) -> dict[str, Any]:
    found = json.loads(text, object_pairs_hook=_unique)
    if not isinstance(found, dict):
        raise ValueError("not an object")  # noqa: TRY004 - one kind of refusal for the caller
    return found


def _unique(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """Refuse a name that stands twice: the reader and the signer may each believe another."""
    fields = dict(pairs)
    if len(fields) != len(pairs):
        raise ValueError("a field stands twice")
    return fields


def _claims_of(token: object, public_key: RSAPublicKey) -> Mapping[str, Any]:
    if not isinstance(token, str) or not token:
        raise PushRefusal("signature", "The push is not signed.")
    try:
        return jwt.decode(
            token,
            public_key,
            algorithms=[_ALGORITHM],
            options={
                "verify_aud": False,
                "verify_iat": False,
                "verify_exp": False,
                "verify_nbf": False,
                "verify_iss": False,
                "verify_sub": False,
                "verify_jti": False,
            },
        )
    except (jwt.PyJWTError, ValueError, RecursionError):
        raise PushRefusal("signature", "The push is not signed by RockBLOCK's key.") from None


def _check_time(signed: Mapping[str, Any], now: datetime) -> None:
    """Refuse a signature outside of the time that it says it is for (RFC 7519, 4.1.4 and 4.1.5)."""
    for name, is_over in (("exp", True), ("nbf", False)):
        if name not in signed:
            continue
        try:
            limit_s = float(signed[name])
        except (TypeError, ValueError, OverflowError):
            limit_s = math.nan
        late_s = now.timestamp() - limit_s
        holds = late_s < _CLOCK_ERROR_S if is_over else late_s > -_CLOCK_ERROR_S
        if not (holds and math.isfinite(limit_s)):
            raise PushRefusal("expired", "The push's signature does not hold at this time.")


def _check_agreement(said: Mapping[str, Any], signed: Mapping[str, Any]) -> None:
    both = (set(said) & set(signed)) | set(_SIGNED)
    for name in sorted(both):
        if not _equal(name, said.get(name, ""), signed.get(name, "")):
            raise PushRefusal("disagrees", f"{name} is not what was signed.")


def _equal(name: str, said: object, signed: object) -> bool:
    if name in _NUMBERS:
        try:
            return Decimal(str(said)) == Decimal(str(signed))
        except InvalidOperation:
            return str(said) == str(signed)
    return str(said) == str(signed)


def _time_of(value: object) -> datetime:
    if isinstance(value, str) and _TIME.fullmatch(value):
        try:
            return datetime.strptime(value, "%y-%m-%d %H:%M:%S").replace(tzinfo=UTC)
        except ValueError:
            pass
    raise PushRefusal("malformed", "transmit_time is not YY-MM-DD HH:MM:SS.")


def _payload(value: object) -> tuple[bytes, str]:
    """Return the bytes and what is wrong with them; text that is no hex is kept as it stands."""
    text = value if isinstance(value, str) else str(value)
    if not re.fullmatch(r"(?:[0-9a-fA-F]{2})*", text):
        return text.encode("utf-8", "replace"), "the data is not hexadecimal"
    data = bytes.fromhex(text)
    return data, payload_fault(data)
