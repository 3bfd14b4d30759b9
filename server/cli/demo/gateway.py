"""What a demo's station and simulator must agree on before both start: gateway and keys."""

import secrets
import socket
import sys
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import urlsplit

from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
    load_pem_private_key,
)
from pydantic import ValidationError

from robot_link.messages import RobotId
from robot_link.whole_file import replace_file
from server.base.secret import GatewayAccount, SecretStore, SecretUnreadableError
from simulator.fleet import FLEET, is_sub
from simulator.settings import GatewaySettings

GATEWAY_FILE = Path("simulator") / "gateway.json"
"""Below the data folder: the emulated gateway's settings, with its private key."""
NETWORK_FILE = Path("simulator") / "satellites.json"
"""Below the data folder: the emulated satellite network's queues."""
MEMORY_FOLDER = "robots"
"""Below the data folder: a folder for each simulated robot's own memory."""
_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_USER = "demo"
_RSA_BITS = 2048


def prepare_gateway(folder: Path, store: SecretStore, station_url: str) -> None:
    """Give the station an account with the emulated gateway, and the gateway its customer.

    An account with a gateway that is not of this machine is left as it is; robots that do not
    exist are then not reached by satellite.
    """
    file = folder / GATEWAY_FILE
    account = store.gateway("rockblock")
    if account is not None and urlsplit(account.url).hostname not in _LOOPBACK:
        file.unlink(missing_ok=True)
        return
    before = read_gateway(folder)
    key = _new_key() if before is None else before.private_key_pem
    settings = GatewaySettings(
        port=free_port(),
        push_url=f"{station_url}/api/gateways/rockblock/push/{store.push_path('rockblock')}",
        username=_USER,
        password=secrets.token_urlsafe(16) if before is None else before.password,
        private_key_pem=key,
    )
    _write_secret(file, settings.model_dump_json(indent=2))
    store.set_gateway(
        "rockblock",
        GatewayAccount(
            url=f"http://127.0.0.1:{settings.port}/rockblock/MT",
            username=settings.username,
            password=settings.password,
            public_key=_public_half(key),
        ),
    )


def read_gateway(folder: Path) -> GatewaySettings | None:
    """Return the emulated gateway's settings; None where there are none that can be read."""
    try:
        return GatewaySettings.model_validate_json((folder / GATEWAY_FILE).read_text())
    except (FileNotFoundError, ValidationError):
        return None


def decide_signing(store: SecretStore, robots: Iterable[RobotId]) -> None:
    """Make the signing key of each robot for which nobody decided whether it signs.

    A robot whose key is damaged goes without radio until a person makes a new one.
    """
    for robot in robots:
        if is_sub(robot):
            store.turn_signing_off(robot)
            continue
        try:
            if store.signing_key(robot) is None and not store.is_signing_off(robot):
                store.new_signing_key(robot)
        except SecretUnreadableError as error:
            print(f"{robot} has no radio until it has a new key: {error}", file=sys.stderr)


def give_keys(folder: Path, store: SecretStore, robots: Iterable[RobotId]) -> None:
    """Write into each robot's memory the keys that it shares with the station.

    A signing key that somebody put there stays where the station of this folder has none. Of a key
    that is damaged at the station, the robot keeps its own copy, and nobody else goes without.
    """
    for robot in robots:
        if is_sub(robot):
            continue
        memory = folder / MEMORY_FOLDER / robot
        for give in (_give_satellite_key, _give_signing_key):
            try:
                give(memory, store, robot)
            except SecretUnreadableError as error:
                print(f"{robot} is given no new key: {error}", file=sys.stderr, flush=True)


def _give_satellite_key(memory: Path, store: SecretStore, robot: RobotId) -> None:
    if FLEET[robot].imei:
        _write_secret(memory / "robot.key", store.robot_key(robot).hex())


def _give_signing_key(memory: Path, store: SecretStore, robot: RobotId) -> None:
    key = store.signing_key(robot)
    if key is not None:
        _write_secret(memory / "signing.key", key.hex())
    elif store.is_signing_off(robot):
        (memory / "signing.key").unlink(missing_ok=True)


def _write_secret(file: Path, text: str) -> None:
    """Replace a file that nobody but its user may read."""
    replace_file(file, text.encode(), mode=0o600)


def free_port() -> int:
    """Return a port of the loopback that nobody has now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _new_key() -> str:
    key = rsa.generate_private_key(public_exponent=65537, key_size=_RSA_BITS)
    pem = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    return pem.decode("ascii")


def _public_half(private_pem: str) -> str:
    key = load_pem_private_key(private_pem.encode(), password=None).public_key()
    pem = key.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    return pem.decode("ascii")
