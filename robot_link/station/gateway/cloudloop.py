"""Cloudloop: Ground Control's newer service, JSON in both directions.

From a robot it pushes a "LingoMO": ``id``, ``receivedAt``, ``identity``, ``sbd`` (at the top or
below ``header``; IMEI, MOMSN, MTMSN, session time, status, location) and ``message``, base64
that may lack its padding. Nothing is signed: what proves the sender is the secret path of the
push, and what proves the robot is the record itself.

To a robot, ``token``, ``thing`` (the modem's id there) and ``message`` (hex) are posted to
``Data/DoSendSbdMessage``; the answer is JSON with the message's ``id``, or with ``error``.

Source: knowledge.cloudloop.com, "LingoMO" and "Send Messages (MT)".
"""

import base64
import json
from collections.abc import Awaitable, Callable, Mapping
from datetime import UTC, datetime
from typing import Any, Final, cast

from robot_link.station.gateway.gateway import (
    GatewayFault,
    GatewayRefusal,
    MobileOriginated,
    Retry,
    Taken,
    check_message,
    is_imei,
)
from robot_link.station.gateway.http import FormPoster
from robot_link.station.gateway.push import PushRefusal, payload_fault, place_of, whole_number

CARRIER: Final = "cloudloop"
_STATUS_OK: Final = "SESSION_STATUS_OK"
_UNTOLD_STATUS: Final = -1
_TEXT_MAX: Final = 120

_REFUSALS: Final[dict[int, tuple[GatewayFault, Retry, str]]] = {
    400: (GatewayFault.BAD_DATA, "never", "Cloudloop could not read the message."),
    401: (GatewayFault.LOGIN, "never", "Cloudloop refuses the account's token; enter it again."),
    403: (GatewayFault.LOGIN, "never", "Cloudloop refuses the account's token; enter it again."),
    404: (
        GatewayFault.UNKNOWN_IMEI,
        "never",
        "Cloudloop does not know the thing of modem {imei}; check the robot's link.",
    ),
    402: (GatewayFault.NO_CREDIT, "never", "The Cloudloop account has no credits left."),
    409: (
        GatewayFault.NO_LINE_RENTAL,
        "never",
        "Cloudloop takes nothing for modem {imei}; check its line rental and its registration.",
    ),
    413: (GatewayFault.TOO_LONG, "never", "Cloudloop says that the message is too long."),
    429: (GatewayFault.BUSY, "later", "Cloudloop has no room at the moment; it is tried again."),
}

Fields = Mapping[str, Any]
ThingOf = Callable[[str], Awaitable[str | None]]
"""Returns Cloudloop's id of the modem with an IMEI."""


def read_push(body: bytes, arrived_at: datetime) -> MobileOriginated:
    """Return the message that a push brings.

    Raises:
        PushRefusal: If it is no LingoMO of an Iridium SBD session.
    """
    lingo = _document(body)
    sbd = _part(lingo, "sbd") or _part(_part(lingo, "header"), "sbd")
    if not sbd:
        raise PushRefusal("malformed", "The push tells of no SBD session.")
    place = _part(sbd, "location")
    latitude_deg, longitude_deg, cep_km = place_of(
        place.get("latitude"), place.get("longitude"), place.get("cep")
    )
    data, fault = _payload(lingo.get("message", ""))
    mtmsn = whole_number(sbd.get("mtmsn") or 0, "mtmsn", 0xFFFF)
    return MobileOriginated(
        carrier=CARRIER,
        imei=_imei_of(lingo, sbd),
        momsn=whole_number(sbd.get("momsn") or 0, "momsn", 0xFFFF),
        mtmsn=mtmsn or None,
        session_at=_time_of(_part(sbd, "sessionAt") or _part(lingo, "receivedAt")),
        arrived_at=arrived_at,
        data=data,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        cep_km=cep_km,
        session_status=_status_of(sbd.get("status", _STATUS_OK)),
        fault=fault,
    )


class CloudloopGateway:
    """Sends through Cloudloop.

    Args:
        url: Where to post, ``https://api.cloudloop.com/Data/DoSendSbdMessage``.
        token: Of the account; it travels in the body alone.
        thing_of: Returns Cloudloop's id of a modem.
        total_s: Longest time for one message.
    """

    carrier = CARRIER

    def __init__(self, url: str, token: str, thing_of: ThingOf, total_s: float = 15.0) -> None:
        self._token = token
        self._thing_of = thing_of
        self._poster = FormPoster(url, "Cloudloop", total_s)

    async def send(
        self, imei: str, data: bytes, *, client_id: int, flush: bool = False, priority: int = 5
    ) -> Taken:
        """Hand one message over; see ``SatelliteGateway.send``. Cloudloop cannot flush."""
        del flush
        check_message(imei, data, client_id, priority)
        thing = await self._thing_of(imei)
        if thing is None:
            raise GatewayRefusal(
                GatewayFault.UNKNOWN_IMEI,
                f"No robot's link names the Cloudloop thing of modem {imei}.",
            )
        status, text = await self._poster.post(
            {"token": self._token, "thing": thing, "message": data.hex()}
        )
        return self._taken(imei, status, text)

    async def close(self) -> None:
        """Give connections up."""
        await self._poster.close()

    def _taken(self, imei: str, status: int, text: str) -> Taken:
        if status in _REFUSALS:
            fault, retry, sentence = _REFUSALS[status]
            raise GatewayRefusal(fault, sentence.format(imei=imei), retry)
        try:
            answer = _document(text.encode("utf-8", "replace"))
        except PushRefusal:
            answer = {}
        message_id = answer.get("id")
        if isinstance(message_id, str | int) and str(message_id) and not answer.get("error"):
            return Taken(str(message_id)[:_TEXT_MAX], None, None)
        if answer.get("error"):
            raise GatewayRefusal(
                GatewayFault.OTHER,
                f"Cloudloop refused the message: {self._clean(str(answer['error']))}.",
            )
        raise GatewayRefusal(
            GatewayFault.PROTOCOL,
            f"Cloudloop answered what it never should (HTTP {status}); check the address.",
        )

    def _clean(self, said: str) -> str:
        """Return what the gateway said, short, printable and without the account's token."""
        text = said.replace(self._token, "...") if self._token else said
        return "".join(c for c in text if c.isprintable())[:_TEXT_MAX].rstrip(". ")


def _document(body: bytes) -> Fields:
    try:
        found = json.loads(body.decode("utf-8"))
    except (ValueError, RecursionError):
        raise PushRefusal("malformed", "This is no push of Cloudloop.") from None
    if not isinstance(found, dict):
        raise PushRefusal("malformed", "This is no push of Cloudloop.")
    return cast("Fields", found)


def _part(document: Fields, name: str) -> Fields:
    part = document.get(name)
    return cast("Fields", part) if isinstance(part, dict) else {}


def _imei_of(lingo: Fields, sbd: Fields) -> str:
    """Return the modem's IMEI, which must be the same wherever it stands."""
    identity = _part(lingo, "identity")
    said = [sbd.get("imei"), _part(identity, "hardware").get("imei"), identity.get("identifier")]
    found = {imei for imei in said if isinstance(imei, str) and is_imei(imei)}
    if len(found) != 1:
        raise PushRefusal("malformed", "The push names no modem, or more than one.")
    return found.pop()


def _time_of(fields: Fields) -> datetime:
    names = ("year", "month", "day", "hour", "minute", "second")
    numbers = [
        whole_number(fields.get(name, 0 if i > 2 else None), name, 9999)
        for i, name in enumerate(names)
    ]
    try:
        return datetime(*numbers, tzinfo=UTC)  # pyright: ignore[reportArgumentType]
    except ValueError:
        raise PushRefusal("malformed", "The time of the session is none.") from None


def _status_of(value: object) -> int:
    if value == _STATUS_OK:
        return 0
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 0xFF:
        return value
    return _UNTOLD_STATUS


def _payload(value: object) -> tuple[bytes, str]:
    """Return the bytes and what is wrong with them; text that is no base64 is kept as it is."""
    text = value if isinstance(value, str) else "" if value is None else str(value)
    bare = text.rstrip("=")
    try:
        data = base64.b64decode(bare + "=" * (-len(bare) % 4), validate=True)
    except ValueError:
        return text.encode("utf-8", "replace"), "the message is not base64"
    return data, payload_fault(data)
