"""Taking the URI of a link or a camera apart, and saying what is wrong with it."""

import re
from collections.abc import Mapping
from typing import Final, NoReturn, TypeVar
from urllib.parse import parse_qsl, urlsplit

from robot_link.transport.datagram import Address

Value = TypeVar("Value")
_ADDRESS_DIGITS: Final = 16
_MACHINE: Final = re.compile(r"[\w.-]+|[0-9a-fA-F:.]+")
_DECIMAL: Final = re.compile(r"[0-9]{1,9}(\.[0-9]{1,9})?")


class LinkUri:
    """The parts of ``scheme://host:port?options#address`` or ``scheme:///path?options#address``.

    Every complaint is a ``ValueError`` that repeats the URI and names the part.
    """

    def __init__(self, uri: str, noun: str = "link") -> None:
        """Take a URI apart.

        Args:
            uri: As somebody wrote it.
            noun: What it leads to, as complaints call it.

        Raises:
            ValueError: If it is none.
        """
        self._uri, self._noun = uri, noun
        if not uri.isprintable() or " " in uri:
            self.refuse(f"a {noun} is written without spaces and control characters")
        try:
            parts = urlsplit(uri)
            self.port = parts.port
        except ValueError as error:
            self.refuse(str(error))
        self.scheme = parts.scheme
        self.host = parts.hostname or ""
        self.netloc = parts.netloc
        self.path = parts.path
        self.query = parts.query
        if "@" in parts.netloc:
            self.refuse(f"a {noun} has no user name and no password")
        if parts.fragment and self.scheme != "xbee":
            self.refuse("only a radio of an XBee network is named after a #")
        self.address = self._address(parts.fragment) if parts.fragment else None
        """The robot's radio that the URI names, behind a ``#``."""
        self._options: dict[str, str] = {}
        for name, value in parse_qsl(parts.query, keep_blank_values=True):
            if name in self._options:
                self.refuse(f"{name} is given twice")
            self._options[name] = value

    def refuse(self, complaint: str) -> NoReturn:
        """Say what is wrong.

        Raises:
            ValueError: Always.
        """
        raise ValueError(f"{self._uri}: {complaint}")

    def options(self) -> tuple[str, ...]:
        """Return the names of the options that nobody took yet."""
        return tuple(self._options)

    def word(self, name: str, default: str) -> str:
        """Take an option as it is written out of the options."""
        return self._options.pop(name, default)

    def _address(self, text: str) -> Address:
        if len(text) > _ADDRESS_DIGITS or set(text.lower()) - set("0123456789abcdef"):
            self.refuse(
                f"a radio's address is 1 to {_ADDRESS_DIGITS} hexadecimal digits, not {text!r}"
            )
        return Address(int(text, 16))

    def whole(self, name: str, default: int, least: int, most: int) -> int:
        """Take a whole number out of the options."""
        text = self._options.pop(name, str(default))
        if not text.isdecimal() or not text.isascii():
            self.refuse(f"{name} must be a whole number, not {text!r}")
        if not least <= int(text[:18]) <= most:
            self.refuse(f"{name} must be {least} to {most}, not {text[:18]}")
        return int(text)

    def decimal(self, name: str, default: Value, least: float, most: float) -> float | Value:
        """Take a decimal number out of the options."""
        text = self._options.pop(name, None)
        if text is None:
            return default
        if not _DECIMAL.fullmatch(text):
            self.refuse(f"{name} must be a number, not {text[:20]!r}")
        if not least <= float(text) <= most:
            self.refuse(f"{name} must be {least:g} to {most:g}, not {text}")
        return float(text)

    def switch(self, name: str) -> bool:
        """Take an option that is 0 or 1 out of the options; absent it is 0."""
        return self.choice(name, {"0": False, "1": True}, default=False)

    def choice(self, name: str, values: Mapping[str, Value], default: Value) -> Value:
        """Take one of a few words out of the options."""
        text = self._options.pop(name, None)
        if text is None:
            return default
        if text not in values:
            self.refuse(f"{name} must be {' or '.join(values)}, not {text!r}")
        return values[text]

    def line(self) -> str:
        """Return the path of a serial line."""
        if self.host or self.port is not None:
            self.refuse("the path of a serial line begins after three slashes, as in :///dev/ttyS0")
        if not self.path.strip("/"):
            self.refuse("a serial link needs the path of its line")
        return self.path

    def host_and_port(self, kind: str) -> tuple[str, int]:
        """Return where a network link leads."""
        if not self.host or not self.port:
            self.refuse(f"a {kind} link needs host and port")
        self.check_host()
        if self.path.strip("/"):
            self.refuse(f"a {kind} link has no path")
        return self.host, self.port

    def check_host(self) -> None:
        """Complain of a host that no machine can have as its name."""
        try:
            self.host.encode("idna")
        except UnicodeError:
            self.refuse(f"{self.host!r} cannot be the name of a machine")
        if not _MACHINE.fullmatch(self.host):
            self.refuse(f"{self.host!r} cannot be the name of a machine")

    def finish(self) -> None:
        """Complain of options that nobody took."""
        if self._options:
            self.refuse(f"unknown option {', '.join(self._options)}")
