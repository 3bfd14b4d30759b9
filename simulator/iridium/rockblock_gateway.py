"""RockBLOCK's web service: takes messages to modems, pushes those from them.

To a modem: ``POST .../rockblock/MT`` with ``imei, username, password, data`` (hexadecimal) and
perhaps ``flush=yes``, in the query or in a form; answered ``OK,<id>`` or ``FAILED,<code>,<text>``.
From a modem: a form or JSON with ``imei, serial, momsn, transmit_time, iridium_latitude,
iridium_longitude, iridium_cep, data`` and a ``JWT`` that repeats them, signed with RS256.

Source: Ground Control, RockBLOCK web services, "Sending an MT message", "Receiving an MO message".
"""

from contextlib import AbstractAsyncContextManager
from enum import IntEnum
from http import HTTPStatus
from typing import Literal

import jwt
from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey

from simulator.iridium.acceptance import Reason, RefusedError
from simulator.iridium.http_server import Answer, Request
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.push import Pusher, RetrySchedule
from simulator.iridium.session import MobileOriginatedMessage
from simulator.iridium.web_service import WebService
from simulator.iridium.webhook import Webhook

PATH = "/rockblock/MT"
ANSWER_TIMEOUT_S = 3.0
"""A customer that has not answered 200 by then is offered the message again."""
SCHEDULE = RetrySchedule((5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 600.0))

_BROKEN_OFF = 13


class Failure(IntEnum):
    """Codes of ``FAILED``."""

    LOGIN = 10
    NOT_YOURS = 11
    NO_LINE_RENTAL = 12
    NO_CREDIT = 13
    BAD_HEX = 14
    TOO_LONG = 15
    NO_DATA = 16
    SYSTEM = 99


_TEXTS = {
    Failure.LOGIN: "Invalid login credentials",
    Failure.NOT_YOURS: "No RockBLOCK with this IMEI found on your account",
    Failure.NO_LINE_RENTAL: "RockBLOCK has no line rental",
    Failure.NO_CREDIT: "Your account has insufficient credit",
    Failure.BAD_HEX: "Could not decode hex data",
    Failure.TOO_LONG: "Data too long",
    Failure.NO_DATA: "No data",
    Failure.SYSTEM: "System error",
}
_CODES = {
    Reason.UNKNOWN_IMEI: Failure.NOT_YOURS,
    Reason.NO_LINE_RENTAL: Failure.NO_LINE_RENTAL,
    Reason.NO_CREDIT: Failure.NO_CREDIT,
    Reason.TOO_LONG: Failure.TOO_LONG,
    Reason.EMPTY: Failure.NO_DATA,
}


class RockBlockGateway:
    """The web service of one network; belongs to one event loop.

    Args:
        network: The network behind it; its subscribers of carrier ``rockblock`` are served.
        private_key: Signs what is pushed.
        push_url: Where messages from modems go; None keeps them.
        push_format: ``form`` or ``json``.
    """

    def __init__(
        self,
        network: IridiumNetwork,
        private_key: RSAPrivateKey,
        push_url: str | None,
        *,
        push_format: Literal["form", "json"] = "form",
    ) -> None:
        self._network = network
        self._key = private_key
        self._format = push_format
        self.webhook = Webhook(push_url, ANSWER_TIMEOUT_S)
        self.pusher = Pusher(self._push, SCHEDULE, network.clock, network.settle)

    def serve(self, host: str = "127.0.0.1", port: int = 0) -> AbstractAsyncContextManager[str]:
        """Serve until the context is left; see ``WebService.opened``."""
        service = WebService("rockblock", PATH, self.respond, self._take, self.pusher, self.webhook)
        return service.opened(self._network, host, port)

    def respond(self, request: Request) -> Answer | None:
        """Answer a customer."""
        if request.path.rstrip("/") != PATH:
            return Answer("Not found", HTTPStatus.NOT_FOUND)
        if request.method != "POST":
            return Answer("POST only", HTTPStatus.METHOD_NOT_ALLOWED)
        if self._network.conditions.gateway_outage:
            return Answer("Service unavailable", HTTPStatus.SERVICE_UNAVAILABLE)
        result = self._accept(request.fields)
        if isinstance(result, Failure):
            return Answer(f"FAILED,{result.value},{_TEXTS[result]}")
        if self._network.draw(self._network.conditions.answer_loss):
            return None
        return Answer(f"OK,{result}")

    def _accept(self, fields: dict[str, str]) -> int | Failure:
        """Queue a message; return its id."""
        login = (fields.get("username", ""), fields.get("password", ""))
        subscribers = self._network.subscribers
        accounts = {(s.account.username, s.account.password) for s in subscribers.values()}
        if login not in accounts:
            return Failure.LOGIN
        subscriber = subscribers.get(fields.get("imei", "").strip())
        if (
            subscriber is None
            or subscriber.carrier != "rockblock"
            or login != (subscriber.account.username, subscriber.account.password)
        ):
            return Failure.NOT_YOURS
        try:
            data = bytes.fromhex(fields.get("data", ""))
        except ValueError:
            return Failure.BAD_HEX
        if self._network.draw(self._network.conditions.gateway_failure):
            return Failure.SYSTEM
        flush = fields.get("flush", "").lower() == "yes"
        try:
            return self._network.accept(subscriber.imei, data, flush=flush).message_id
        except RefusedError as error:
            return _CODES.get(error.reason, Failure.SYSTEM)

    def _take(self, message: MobileOriginatedMessage) -> None:
        if message.session_status == _BROKEN_OFF:
            self._network.settle(message)
        else:
            self.pusher.put(message)

    async def _push(self, message: MobileOriginatedMessage) -> bool:
        if self._network.conditions.gateway_outage:
            return False
        as_json = self._format == "json"
        values = self._values(message)
        claims = {name: str(value) for name, value in values.items()}
        issued_at = int(self._network.clock.now().timestamp())
        token = jwt.encode({"iss": "Rock 7", "iat": issued_at, **claims}, self._key, "RS256")
        body = values if as_json else claims
        return await self.webhook.post({**body, "JWT": token}, as_json=as_json)

    def _values(self, message: MobileOriginatedMessage) -> dict[str, object]:
        subscriber = self._network.subscriber(message.imei)
        return {
            "imei": message.imei,
            "device_type": "ROCKBLOCK",
            "serial": 0 if subscriber is None else subscriber.serial,
            "momsn": message.momsn,
            "transmit_time": f"{message.session_at:%y-%m-%d %H:%M:%S}",
            "iridium_latitude": round(message.latitude_deg, 4),
            "iridium_longitude": round(message.longitude_deg, 4),
            "iridium_cep": message.cep_km,
            "iridium_session_status": message.session_status,
            "data": message.data.hex(),
        }
