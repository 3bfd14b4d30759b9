"""What the station must know and nobody else may read: keys of robots, accounts with gateways.

Each secret is a file of its own under ``<data>/secret/``, readable by the station's user alone.
None of them is ever logged or put into a URL, and only the key that signs a robot's radio is ever
shown: once, to who had it made. An administrator copies the others from their files.
"""

import asyncio
import contextlib
import logging
import os
import re
import secrets
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Final, Literal, Self, TypeVar, get_args
from urllib.parse import SplitResult, urlsplit

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from sqlalchemy.orm import Session

from autonomy.described import Described
from db.store import Store
from robot_link.whole_file import keep_names

KEY_BYTES: Final = 32
SIGNING_OFF: Final = "off"
"""What the file of a signing key holds where somebody decided that frames are not signed."""
GatewayKind = Literal["rockblock", "directip", "cloudloop"]
GATEWAY_KINDS: Final[tuple[GatewayKind, ...]] = get_args(GatewayKind)
DEFAULT_URLS: Final[dict[GatewayKind, str]] = {
    "rockblock": "https://rockblock.rock7.com/rockblock/MT",
    "directip": "tcp://directip.sbd.iridium.com:10800",
    "cloudloop": "https://api.cloudloop.com/Data/DoSendSbdMessage",
}
_NAME: Final = re.compile(r"[a-z0-9][a-z0-9-]{0,39}")
_log = logging.getLogger(__name__)

T = TypeVar("T")


class SecretUnreadableError(Exception):
    """A file of the secret folder does not hold what its name says; the text names the file."""


def secret_fault(error: SecretUnreadableError | OSError) -> str:
    """Say why a secret cannot be read; of its file the name alone, not where the folder is."""
    if isinstance(error, SecretUnreadableError):
        return str(error)
    reason = error.strerror or type(error).__name__
    file = error.filename
    return f"{_named(Path(file))}: {reason}." if isinstance(file, str | Path) else f"{reason}."


class GatewayAccount(Described, BaseModel):
    """What the station needs to speak with one gateway."""

    model_config = ConfigDict(frozen=True, extra="forbid", hide_input_in_errors=True)

    url: str = Field(max_length=500)
    """Where messages to robots go: ``https://...``, of DirectIP ``tcp://host:port``."""
    username: str = Field(default="", max_length=200)
    """Name of the account; Cloudloop and DirectIP have none."""
    password: str = Field(default="", max_length=500, repr=False)
    """Password of the account, or Cloudloop's token."""
    public_key: str = Field(default="", max_length=8000)
    """PEM of the key with which RockBLOCK signs what it pushes."""
    confirms: bool = False
    """Whether DirectIP expects the station to confirm each message of a robot."""

    @model_validator(mode="after")
    def _has_a_place(self) -> Self:
        try:
            parts = urlsplit(self.url)
            known = bool(parts.hostname) and (parts.scheme != "tcp" or bool(parts.port))
            known = known and self.url.isascii() and self.url.isprintable()
        except ValueError:
            known = False
            parts = urlsplit("")
        if not known or parts.scheme not in ("https", "http", "tcp"):
            raise ValueError("url is https://host/path, or tcp://host:port of DirectIP")
        if parts.username or parts.password or parts.query or parts.fragment:
            raise ValueError("url holds no password and no options; they have their own fields")
        if parts.scheme == "http" and not _is_loopback(parts):
            raise ValueError("url must be https: the password would travel in the clear")
        return self


class CameraAccount(Described, BaseModel):
    """What a camera in the network asks for before it shows pictures."""

    model_config = ConfigDict(frozen=True, extra="forbid", hide_input_in_errors=True)

    user: str = Field(max_length=200)
    """Name of the account."""
    password: str = Field(max_length=500, repr=False)
    """Password of the account."""


class SecretStore:
    """The secret folder of one station; several processes of its user may share it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def robot_key(self, robot: str) -> bytes:
        """Return the key that station and robot share on satellite links, made at first need.

        Returns:
            32 bytes.

        Raises:
            SecretUnreadableError: If its file holds anything else.
        """
        file = self._file("robot", robot)
        return _key_of(file, _read(file) or _create(file, secrets.token_bytes(KEY_BYTES).hex()))

    def browser_key(self) -> bytes:
        """Return the key that marks the browsers of people, made at first need.

        A damaged one is replaced: all that is lost is that browsers are known.
        """
        return self._own_key(self._file("browser", "marks"), "no browser is known any more")

    def signing_key(self, robot: str) -> bytes | None:
        """Return the key that signs MAVLink with a robot; None where frames are not signed.

        Raises:
            SecretUnreadableError: If its file holds neither 32 bytes nor that signing is off.
        """
        file = self._file("signing", robot)
        text = _read(file)
        return None if text is None or text.strip() == SIGNING_OFF else _key_of(file, text)

    def is_signing_off(self, robot: str) -> bool:
        """Tell whether somebody decided that a robot's frames are not signed."""
        return (_read(self._file("signing", robot)) or "").strip() == SIGNING_OFF

    def new_signing_key(self, robot: str) -> bytes:
        """Make the key that signs MAVLink with a robot; the one before it is gone."""
        key = secrets.token_bytes(KEY_BYTES)
        self._decide_signing(robot, key.hex())
        return key

    def turn_signing_off(self, robot: str) -> None:
        """Keep that a robot's frames are not signed; the key that it had is gone."""
        self._decide_signing(robot, SIGNING_OFF)

    async def decide_with(self, store: Store, robot: str, write: Callable[[Session], T]) -> T:
        """Await a change that decides how a robot signs; both are kept, or neither.

        Args:
            store: Where the change is made.
            robot: Whose signing the change decides.
            write: The change; it calls ``new_signing_key`` or ``turn_signing_off``.

        Raises:
            OSError: If the decision cannot be kept.
        """
        before: list[_Before] = []

        def change(session: Session) -> T:
            before.append(_Before(self._file("signing", robot), self.signing_marks(robot)))
            return write(session)

        def settle(done: Future[T]) -> None:
            is_kept = not done.cancelled() and done.exception() is None
            for one in before:
                one.settle(is_kept=is_kept)

        made = store.change(change)
        # On the writer's thread: no other decision begins before this one is kept or taken back.
        made.add_done_callback(settle)
        return await asyncio.wrap_future(made)

    def _decide_signing(self, robot: str, text: str) -> None:
        """Keep a decision; stamps of frames under the key before it mean nothing any more."""
        _write(self._file("signing", robot), text)
        self.signing_marks(robot).unlink(missing_ok=True)

    def signing_marks(self, robot: str) -> Path:
        """Return the file in which the stamps of signed frames outlive a restart."""
        return self._file("stamps", robot)

    def gateway(self, kind: GatewayKind) -> GatewayAccount | None:
        """Return the account with a gateway; None where there is none.

        Raises:
            SecretUnreadableError: If its file does not hold one.
        """
        file = self._file("gateway", kind)
        text = _read(file)
        if text is None:
            return None
        try:
            return GatewayAccount.model_validate_json(text)
        except ValidationError:
            raise SecretUnreadableError(
                f"{_named(file)} holds no account; enter it again."
            ) from None

    def set_gateway(self, kind: GatewayKind, account: GatewayAccount) -> None:
        """Keep the account with a gateway."""
        _write(self._file("gateway", kind), account.model_dump_json(indent=2))

    def push_path(self, kind: GatewayKind) -> str:
        """Return the word in the URL that only the gateway knows, made at first need."""
        file = self._file("push", kind)
        return (_read(file) or _create(file, secrets.token_urlsafe(24))).strip()

    def notice_address(self, name: str) -> str | None:
        """Return where notices go: to a contact, by a mail server, to who watches the station.

        Raises:
            SecretUnreadableError: If its file holds no text.
        """
        return _read(self._file("notice", name))

    def set_notice_address(self, name: str, text: str | None) -> None:
        """Keep where notices go, or forget it."""
        file = self._file("notice", name)
        if text is None:
            file.unlink(missing_ok=True)
        else:
            _write(file, text)

    def camera_account(self, camera: str) -> CameraAccount | None:
        """Return the account with a camera; None where it has none.

        Raises:
            SecretUnreadableError: If its file does not hold one.
        """
        file = self._file("camera", camera)
        text = _read(file)
        try:
            return None if text is None else CameraAccount.model_validate_json(text)
        except ValidationError:
            raise SecretUnreadableError(
                f"{_named(file)} holds no account; enter it again."
            ) from None

    def set_camera_account(self, camera: str, account: CameraAccount | None) -> None:
        """Keep the account with a camera, or forget it."""
        file = self._file("camera", camera)
        if account is None:
            file.unlink(missing_ok=True)
        else:
            _write(file, account.model_dump_json(indent=2))

    def notice_key(self) -> bytes:
        """Return the key that signs the links of notices, made at first need.

        A damaged one is replaced: links that were sent before acknowledge nothing any more.
        """
        return self._own_key(self._file("links", "notice"), "no earlier link is taken any more")

    def _own_key(self, file: Path, cost: str) -> bytes:
        """Return a key that the station alone uses, made at first need and where it is damaged."""
        fresh = secrets.token_bytes(KEY_BYTES)
        try:
            return _key_of(file, _read(file) or _create(file, fresh.hex()))
        except SecretUnreadableError as error:
            _log.warning("%s A new key takes its place; %s.", error, cost)
            _write(file, fresh.hex())
            return fresh

    def _file(self, kind: str, name: str) -> Path:
        if not _NAME.fullmatch(name):
            raise ValueError(f"{name!r} is not the name of a robot, gateway, contact or camera")
        return self._folder / f"{kind}-{name}"


class _Before:
    """A robot's key and stamps before a decision, by second names: to go back takes no room.

    Raises:
        OSError: If the disk refuses.
    """

    def __init__(self, key: Path, marks: Path) -> None:
        self._key, self._marks = key, marks
        for file in (key, marks):
            _second(file).unlink(missing_ok=True)
            with contextlib.suppress(FileNotFoundError):
                os.link(file, _second(file))

    def settle(self, *, is_kept: bool) -> None:
        """Go back unless the decision is kept, and drop the second names."""
        try:
            if not is_kept:
                self._go_back()
            for file in (self._key, self._marks):
                _second(file).unlink(missing_ok=True)
            if self._key.parent.exists():
                keep_names(self._key.parent)
        except OSError as error:
            _log.error("%s is left half changed: %s", _named(self._key), error.strerror)

    def _go_back(self) -> None:
        if _second(self._key).exists():
            _second(self._key).replace(self._key)
        else:
            self._key.unlink(missing_ok=True)
        # Stamps that were kept since then are the newer ones.
        with contextlib.suppress(FileNotFoundError, FileExistsError):
            os.link(_second(self._marks), self._marks)


def _second(file: Path) -> Path:
    return file.with_name(f".{file.name}.before")


def _is_loopback(parts: SplitResult) -> bool:
    return parts.hostname in ("localhost", "127.0.0.1", "::1")


def _named(file: Path) -> str:
    """Return what a person is told of a file: where in the data folder, not where that is."""
    return f"{file.parent.name}/{file.name}"


def _key_of(file: Path, text: str) -> bytes:
    try:
        key = bytes.fromhex(text)
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES:
        raise SecretUnreadableError(
            f"{_named(file)} does not hold {KEY_BYTES} bytes in hexadecimal."
        )
    return key


def _read(file: Path) -> str | None:
    try:
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except UnicodeDecodeError:
        raise SecretUnreadableError(f"{_named(file)} holds no text.") from None


def _create(file: Path, text: str) -> str:
    """Write a secret unless there is one by now, and return the one that holds."""
    fresh = _written_beside(file, text)
    try:
        os.link(fresh, file)
    except FileExistsError:
        return file.read_text(encoding="utf-8")
    finally:
        fresh.unlink()
    keep_names(file.parent)
    return text


def _write(file: Path, text: str) -> None:
    """Replace a secret at once, so that a cut leaves the old one or the new one."""
    _written_beside(file, text).replace(file)
    keep_names(file.parent)


def _written_beside(file: Path, text: str) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    with contextlib.suppress(PermissionError):
        file.parent.chmod(0o700)
    fresh = file.with_name(f".{file.name}.{secrets.token_hex(8)}")
    descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with open(descriptor, "w", encoding="utf-8") as handle:
        handle.write(text)
        handle.flush()
        os.fsync(handle.fileno())
    return fresh
