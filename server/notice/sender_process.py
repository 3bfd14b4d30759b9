"""Runs in a process of its own: hands messages to services by apprise, each in its own thread.

Apprise blocks, so a service that hangs holds its thread and nobody else. Requests come as lines of
JSON on the input, answers leave on the output in the order in which services answer, after an
empty line that says that it listens; the end of the input ends the process. What a service replies
is noted where the bytes come in, since apprise itself tells only whether it went well. An answer
never holds an address: those are secrets.
"""

import json
import logging
import smtplib
import socket
import ssl
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Final, TypeVar

import apprise
import requests

REPLY_LENGTH_MAX: Final = 300
_LONGEST_S: Final = 10.0
"""Between two pieces of an answer."""
_KINDS: Final = {"critical": "failure", "severe": "failure", "warning": "warning"}
"""What apprise calls the levels; the others are information."""
_REFUSED: Final = range(400, 500)
_LATER: Final = frozenset({408, 425, 429})
"""Statuses of HTTP that say: not now."""
_BYE: Final = 221
_SMTP_REFUSED: Final = range(500, 600)
_NO_CONNECTION: Final = (
    ConnectionRefusedError,
    socket.gaierror,
    requests.exceptions.ConnectTimeout,
    ssl.SSLCertVerificationError,
)
_R = TypeVar("_R")
_noted = threading.local()


def main() -> None:
    """Serve until the input ends."""
    logging.getLogger("apprise").addHandler(logging.NullHandler())
    socket.setdefaulttimeout(_LONGEST_S)
    requests.Session.send = _noting_http(requests.Session.send)
    smtplib.SMTP.getreply = _noting_smtp(smtplib.SMTP.getreply)
    smtplib.SMTP.connect = _noting_smtp(smtplib.SMTP.connect)
    out, answers = threading.Lock(), sys.stdout
    sys.stdout = sys.stderr  # what a plugin prints is no answer

    def serve(request: dict[str, Any]) -> None:
        answer = hand_over(request)
        with out:
            answers.write(json.dumps(answer) + "\n")
            answers.flush()

    answers.write("\n")  # ready
    answers.flush()
    for line in sys.stdin:
        request = json.loads(line)
        threading.Thread(target=serve, args=(request,), daemon=True).start()


def hand_over(request: dict[str, Any]) -> dict[str, Any]:
    """Hand one message to one service and return its number, whether it went, and the reply."""
    _noted.reply, _noted.is_refusal, _noted.is_doubtful = "", False, True
    begun_s = time.monotonic()
    try:
        service = apprise.Apprise.instantiate(request["url"])
        is_handed = service is not None and bool(
            service.notify(
                title=request["title"],
                body=request["text"],
                notify_type=apprise.NotifyType(_KINDS.get(request["level"], "info")),
                body_format=apprise.NotifyFormat.TEXT,
            )
        )
        if service is None:
            _noted.reply, _noted.is_refusal = "The address is none that apprise knows.", True
            _noted.is_doubtful = False
    except Exception as error:  # noqa: BLE001 - of a hundred plugins; its text may hold an address
        is_handed, _noted.reply = False, f"The service's plugin failed: {type(error).__name__}."
    reply = _noted.reply or ("It was taken." if is_handed else "It was not taken; no reply came.")
    return {
        "number": request["number"],
        "is_handed": is_handed,
        "is_refusal": not is_handed and _noted.is_refusal,
        "is_doubtful": not is_handed and _noted.is_doubtful,
        "reply": reply,
        "took_s": time.monotonic() - begun_s,
    }


def _noting_http(send: Callable[..., requests.Response]) -> Callable[..., requests.Response]:
    def noting(*args: Any, **options: Any) -> requests.Response:  # noqa: ANN401 - as requests has it
        try:
            answer = send(*args, **options)
            text = answer.text
        except (requests.RequestException, OSError) as error:
            _noted.reply, _noted.is_refusal = http_fault(error), False
            _noted.is_doubtful = not _never_left(error)
            raise
        said = " ".join(text.split())[:REPLY_LENGTH_MAX]
        _noted.reply = f"HTTP {answer.status_code} {answer.reason}" + (f": {said}" if said else "")
        _noted.is_refusal = answer.status_code in _REFUSED and answer.status_code not in _LATER
        _noted.is_doubtful = False
        return answer

    return noting


def _noting_smtp(function: Callable[..., _R]) -> Callable[..., _R]:
    def noting(*args: Any, **options: Any) -> _R:  # noqa: ANN401 - as smtplib has it
        try:
            found = function(*args, **options)
        except (smtplib.SMTPException, OSError) as error:
            _noted.reply, _noted.is_doubtful = _fault(error), not _never_left(error)
            raise
        # A goodbye tells nothing of the mail, and what follows a refusal only tidies up after it.
        if isinstance(found, tuple) and found[0] != _BYE and not _noted.is_refusal:
            code, said = found
            words = said.decode(errors="replace") if isinstance(said, bytes) else str(said)
            _noted.reply = f"SMTP {code} {' '.join(words.split())[:REPLY_LENGTH_MAX]}"
            _noted.is_refusal = code in _SMTP_REFUSED
            _noted.is_doubtful = False
        return found

    return noting


def http_fault(error: BaseException) -> str:
    """Say what went wrong below HTTP, without the address that the error's own text holds."""
    if isinstance(error, requests.exceptions.SSLError):
        return "Its certificate is not trusted."
    return next(filter(None, map(_fault, _causes(error))), "The connection broke off.")


def _never_left(error: BaseException) -> bool:
    """Tell whether an error proves that nothing of the message reached its service."""
    return any(isinstance(cause, _NO_CONNECTION) for cause in _causes(error))


def _causes(error: BaseException) -> Iterator[BaseException]:
    """Yield an error and what it came of, however the libraries wrapped it."""
    cause: BaseException | None = error
    while cause is not None:
        yield cause
        inner = getattr(cause, "reason", None) or next(
            (one for one in cause.args if isinstance(one, BaseException)), None
        )
        cause = inner if isinstance(inner, BaseException) else cause.__context__


def _fault(error: BaseException) -> str:
    """Name a fault of the network; "" of an error that is none itself."""
    if isinstance(error, TimeoutError | requests.exceptions.Timeout):
        return f"No answer within {_LONGEST_S:.0f} s."
    if isinstance(error, socket.gaierror):
        return "Its name is not known here; is this machine offline?"
    if isinstance(error, ConnectionRefusedError):
        return "The connection was refused."
    if isinstance(error, smtplib.SMTPServerDisconnected):
        return "The mail server broke off."
    if (
        isinstance(error, OSError)
        and error.strerror
        and not isinstance(error, requests.RequestException)
    ):
        return f"{error.strerror}."
    return ""


if __name__ == "__main__":
    main()
