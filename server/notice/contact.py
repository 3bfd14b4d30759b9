"""How a person is reached: what they type, and the address of apprise that it becomes."""

import re
from collections.abc import Mapping
from typing import Any, Final, Literal, Self
from urllib.parse import parse_qsl, quote, urlencode, urlsplit

from pydantic import BaseModel, ConfigDict, Field, model_validator

from autonomy.described import Described

ContactForm = Literal["mail", "ntfy", "webhook", "apprise"]
TIME_LIMITS: Final = {"cto": "5", "rto": "10"}
"""Seconds in which apprise wants a connection, and between two pieces of an answer."""
_PRIORITIES: Final = {"critical": "max", "severe": "high"}
_LOCAL: Final = frozenset(
    {"dbus", "glib", "gnome", "kde", "macosx", "qt", "syslog", "windows", "file"}
)
"""Schemes by which apprise would act on the station's own machine."""
_MAIL: Final = re.compile(r"[^\s@<>,;:\"']{1,64}@[A-Za-z0-9.-]{1,190}")
_TOPIC: Final = re.compile(r"[A-Za-z0-9_-]{1,64}")
_SCHEME: Final = re.compile(r"([a-z][a-z0-9]{1,20})://\S+")


class _Secret(Described, BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", hide_input_in_errors=True)


class MailServer(_Secret):
    """The server by which the station sends mail."""

    host: str = Field(max_length=200, pattern=r"^[A-Za-z0-9.:-]+$")
    port: int = Field(default=587, ge=1, le=65535)
    security: Literal["starttls", "ssl", "none"] = "starttls"
    """``none`` sends in the clear, for a server on this machine or this network."""
    username: str = Field(default="", max_length=200)
    password: str = Field(default="", max_length=500, repr=False)
    sender: str = Field(max_length=255, pattern=rf"^{_MAIL.pattern}$")
    """Address that mails come from."""


class Address(_Secret):
    """Where messages to one contact go; it is kept like a password."""

    form: ContactForm
    address: str = Field(min_length=1, max_length=1000)
    """A mail address; of ntfy ``https://server/topic``; of a webhook its URL; or apprise's URL."""
    token: str = Field(default="", max_length=500, repr=False)
    """Access token of ntfy, where the topic needs one."""

    @model_validator(mode="after")
    def _has_a_place(self) -> Self:
        if not self.address.isprintable() or any(one.isspace() for one in self.address):
            raise ValueError("address has no spaces and no control characters")
        if self.form == "mail":
            if _MAIL.fullmatch(self.address) is None:
                raise ValueError("address is one mail address, such as ann@example.org")
        elif self.form == "apprise":
            found = _SCHEME.fullmatch(self.address)
            if found is None:
                raise ValueError("address is a URL of apprise, such as slack://...")
            if found[1] in _LOCAL:
                raise ValueError(f"{found[1]}:// would act on the station's own machine")
        else:
            self._check_web()
        return self

    def _check_web(self) -> None:
        try:
            parts = urlsplit(self.address)
            is_web = parts.scheme in ("http", "https") and bool(parts.hostname)
            _ = parts.port
        except ValueError:
            is_web, parts = False, urlsplit("")
        if not is_web:
            raise ValueError("address begins with https://, or http:// on a network of your own")
        if self.form == "ntfy" and (
            _TOPIC.fullmatch(parts.path.strip("/")) is None or parts.query or parts.fragment
        ):
            raise ValueError("address of ntfy is https://server/topic")

    def hint(self) -> str:
        """Return what may be shown of it: enough to know it again, nothing to use it by."""
        if self.form == "mail":
            name, _, domain = self.address.partition("@")
            return f"{name[0]}…@{domain}"
        if self.form == "apprise":
            return f"{self.address.partition('://')[0]}://…"
        parts = urlsplit(self.address)
        clear = "" if parts.scheme == "https" else ", not encrypted"
        return f"{self.form} at {parts.hostname}{clear}"


def apprise_url(
    address: Address, mail: MailServer | None, level: str, extras: Mapping[str, str], link: str
) -> str | None:
    """Return apprise's URL of one message; None of a mail that no server would take.

    Args:
        address: Where it goes.
        mail: The station's mail server.
        level: How much the message matters.
        extras: What a webhook is told beside title and text.
        link: Page that a tap on the message opens; "" for none.
    """
    if address.form == "mail":
        return None if mail is None else _mail_url(address.address, mail)
    if address.form == "apprise":
        joint = "&" if "?" in address.address else "?"
        return f"{address.address}{joint}{urlencode(TIME_LIMITS)}"
    parts = urlsplit(address.address)
    secure = "s" if parts.scheme == "https" else ""
    if address.form == "ntfy":
        options = TIME_LIMITS | {"priority": _PRIORITIES.get(level, "default"), "image": "no"}
        if address.token:
            options |= {"auth": "token"}
        if link:
            options |= {"click": link}
        user = _user(parts.username, parts.password) or (
            f"{quote(address.token, safe='')}@" if address.token else ""
        )
        return f"ntfy{secure}://{user}{_place(parts)}{parts.path}?{urlencode(options)}"
    pairs: list[tuple[str, str]] = [*TIME_LIMITS.items()]
    pairs += [(f"-{name}", value) for name, value in parse_qsl(parts.query)]
    pairs += [(f":{name}", value) for name, value in extras.items()]
    if "notice" in extras:
        pairs.append(("+Idempotency-Key", extras["notice"]))
    user = _user(parts.username, parts.password)
    return f"json{secure}://{user}{_place(parts)}{parts.path}?{urlencode(pairs)}"


def _mail_url(to: str, mail: MailServer) -> str:
    user = _user(quote(mail.username, safe=""), quote(mail.password, safe=""))
    secure = "" if mail.security == "none" else "s"
    mode = "insecure" if mail.security == "none" else mail.security
    options = TIME_LIMITS | {
        "to": to,
        "from": mail.sender,
        "smtp": mail.host,
        "mode": mode,
        "format": "text",
    }
    return f"mailto{secure}://{user}{mail.host}:{mail.port}?{urlencode(options)}"


def _user(name: str | None, password: str | None) -> str:
    if not name:
        return ""
    return f"{name}:{password}@" if password else f"{name}@"


def _place(parts: Any) -> str:  # noqa: ANN401 - SplitResult
    host = f"[{parts.hostname}]" if ":" in (parts.hostname or "") else parts.hostname
    return f"{host}:{parts.port}" if parts.port else str(host)
