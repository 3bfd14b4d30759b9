"""Cloudloop's web service: takes messages to modems, posts those from them as "JSON (Lingo)".

To a modem: ``Data/DoSendSbdMessage`` with ``thing``, ``message`` (hexadecimal) and ``token``, in
the query or in a form, or the token as a bearer's; answered with JSON that holds an ``id`` or an
``error``.
From a modem: JSON with ``id, receivedAt, identity, sbd, message``; the message in base64 may lack
its padding.

Source: knowledge.cloudloop.com, "Send Messages (MT)" and "LingoMO". The wording of errors and
their HTTP codes are not documented there; those here are of the usual meaning.
"""

import base64
import hashlib
import json
import uuid
from contextlib import AbstractAsyncContextManager
from datetime import datetime
from http import HTTPStatus
from typing import Final

from simulator.iridium.acceptance import Reason, RefusedError
from simulator.iridium.http_server import Answer, Request
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.push import Pusher, RetrySchedule
from simulator.iridium.session import MobileOriginatedMessage
from simulator.iridium.subscriber import Subscriber
from simulator.iridium.web_service import WebService
from simulator.iridium.webhook import Webhook

PATH = "/Data/DoSendSbdMessage"
ANSWER_TIMEOUT_S = 5.0
SCHEDULE = RetrySchedule(tuple(2.0**n for n in range(1, 15)))
"""2 s, doubling, for about twelve hours."""

_ID_LETTERS: Final = 32
_CODES = {
    Reason.UNKNOWN_IMEI: HTTPStatus.NOT_FOUND,
    Reason.NO_LINE_RENTAL: HTTPStatus.CONFLICT,
    Reason.NOT_ATTACHED: HTTPStatus.CONFLICT,
    Reason.NO_CREDIT: HTTPStatus.PAYMENT_REQUIRED,
    Reason.TOO_LONG: HTTPStatus.BAD_REQUEST,
    Reason.EMPTY: HTTPStatus.BAD_REQUEST,
}


class CloudloopGateway:
    """The web service of one network; belongs to one event loop.

    Args:
        network: The network behind it; its subscribers of carrier ``cloudloop`` are served, each
            by the token that is the password of its account.
        push_url: Where messages from modems go; None keeps them.

    Raises:
        ValueError: If the push URL is not of this machine.
    """

    def __init__(self, network: IridiumNetwork, push_url: str | None) -> None:
        self._network = network
        self.webhook = Webhook(push_url, ANSWER_TIMEOUT_S)
        self.pusher = Pusher(self._push, SCHEDULE, network.clock, network.settle)

    def serve(self, host: str = "127.0.0.1", port: int = 0) -> AbstractAsyncContextManager[str]:
        """Serve until the context is left; see ``WebService.opened``."""
        service = WebService("cloudloop", PATH, self.respond, self._take, self.pusher, self.webhook)
        return service.opened(self._network, host, port)

    def respond(self, request: Request) -> Answer | None:
        """Answer a customer."""
        if request.path != PATH:
            return _error(HTTPStatus.NOT_FOUND, "no such action")
        if request.method not in ("GET", "POST"):
            return _error(HTTPStatus.METHOD_NOT_ALLOWED, "GET or POST only")
        if self._network.conditions.gateway_outage:
            return _error(HTTPStatus.SERVICE_UNAVAILABLE, "service unavailable")
        answer = self._accept(request)
        is_lost = answer.status is HTTPStatus.OK and self._network.draw(
            self._network.conditions.answer_loss
        )
        return None if is_lost else answer

    def _accept(self, request: Request) -> Answer:
        """Queue a message."""
        token = request.fields.get("token", "")
        kind, _, bearer = request.headers.get("authorization", "").partition(" ")
        if not token and kind.lower() == "bearer":
            token = bearer.strip()
        mine = [
            subscriber
            for subscriber in self._network.subscribers.values()
            if subscriber.carrier == "cloudloop" and subscriber.account.password == token
        ]
        if not mine:
            return _error(HTTPStatus.UNAUTHORIZED, "the token is not valid")
        thing = request.fields.get("thing", "")
        subscriber = next((candidate for candidate in mine if candidate.thing == thing), None)
        if subscriber is None:
            return _error(HTTPStatus.NOT_FOUND, "no such thing")
        try:
            data = bytes.fromhex(request.fields.get("message", ""))
        except ValueError:
            return _error(HTTPStatus.BAD_REQUEST, "the message is not hexadecimal")
        if self._network.draw(self._network.conditions.gateway_failure):
            return _error(HTTPStatus.INTERNAL_SERVER_ERROR, "internal error")
        try:
            accepted = self._network.accept(subscriber.imei, data)
        except RefusedError as error:
            return _error(_CODES.get(error.reason, HTTPStatus.SERVICE_UNAVAILABLE), str(error))
        return _json(HTTPStatus.OK, {"id": _identifier(f"message {accepted.message_id}")})

    def _take(self, message: MobileOriginatedMessage) -> None:
        if message.session_status == 0:
            self.pusher.put(message)
        else:
            self._network.settle(message)

    async def _push(self, message: MobileOriginatedMessage) -> bool:
        if self._network.conditions.gateway_outage:
            return False
        subscriber = self._network.subscriber(message.imei)
        if subscriber is None:
            return True
        received_at = self._network.clock.now()
        text = base64.b64encode(message.data).decode("ascii")
        if self._network.draw(0.5):
            text = text.rstrip("=")
        body = lingo(message, subscriber, received_at) | {"message": text}
        return await self.webhook.post(body, as_json=True)


def lingo(
    message: MobileOriginatedMessage, subscriber: Subscriber, received_at: datetime
) -> dict[str, object]:
    """Return what Cloudloop says of a message besides its payload."""
    imei = message.imei
    return {
        "id": str(uuid.uuid5(uuid.NAMESPACE_OID, f"{imei} {message.record_id}")),
        "receivedAt": _moment(received_at),
        "identity": {
            "accountId": _identifier(f"account {subscriber.account.username}"),
            "subscriber": {
                "id": _identifier(f"subscriber {imei}"),
                "type": "SUBSCRIBER_TYPE_SBD",
                "description": "",
            },
            "hardware": {
                "id": _identifier(f"hardware {imei}"),
                "type": "HARDWARE_TYPE_ROCKBLOCK",
                "imei": imei,
                "serial": str(subscriber.serial),
            },
            "identifier": imei,
            "thingId": subscriber.thing,
        },
        "sbd": {
            "imei": imei,
            "cdrReference": str(message.record_id),
            "momsn": message.momsn,
            "mtmsn": message.mtmsn,
            "sessionAt": _moment(message.session_at),
            "status": "SESSION_STATUS_OK",
            "location": {
                "latitude": message.latitude_deg,
                "longitude": message.longitude_deg,
                "cep": float(message.cep_km),
            },
        },
    }


def _moment(at: datetime) -> dict[str, int]:
    names = ("year", "month", "day", "hour", "minute", "second")
    return {name: getattr(at, name) for name in names}


def _identifier(name: str) -> str:
    """Return 32 letters that stand for a thing of this name."""
    digits = hashlib.sha256(name.encode()).digest()[:_ID_LETTERS]
    return "".join(chr(ord("A") + digit % 26) for digit in digits)


def _error(status: HTTPStatus, text: str) -> Answer:
    return _json(status, {"error": text})


def _json(status: HTTPStatus, content: dict[str, str]) -> Answer:
    return Answer(json.dumps(content), status, "application/json")
