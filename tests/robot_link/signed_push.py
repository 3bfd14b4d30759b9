"""Pushes as RockBLOCK makes them, signed with a key that was made for the test."""

import base64
import hashlib
import hmac
import json
from collections.abc import Mapping
from functools import cache
from urllib.parse import urlencode

import jwt
from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey, generate_private_key
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

IMEI = "300234010753370"
FORM = "application/x-www-form-urlencoded"
JSON = "application/json"


@cache
def private_key(bits: int = 2048, number: int = 0) -> RSAPrivateKey:
    del number
    return generate_private_key(65537, bits)


def public_pem(key: RSAPrivateKey | None = None) -> str:
    public = (key or private_key()).public_key()
    return public.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo).decode()


def push_fields(**changed: object) -> dict[str, object]:
    fields: dict[str, object] = {
        "imei": IMEI,
        "serial": 14331,
        "momsn": 66,
        "transmit_time": "26-11-21 10:02:03",
        "iridium_latitude": 45.9123,
        "iridium_longitude": -84.5567,
        "iridium_cep": 3.0,
        "data": "48656c6c6f",
        "device_type": "ROCKBLOCK",
    }
    return fields | changed


def token_of(fields: Mapping[str, object], key: RSAPrivateKey | None = None) -> str:
    claims: dict[str, object] = {"iss": "Rock 7", "iat": 1791279180}
    claims |= {name: str(value) for name, value in fields.items()}
    return jwt.encode(claims, key or private_key(), algorithm="RS256")


def form_push(fields: dict[str, object] | None = None, token: str | None = None) -> bytes:
    fields = push_fields() if fields is None else fields
    return urlencode(fields | {"JWT": token_of(fields) if token is None else token}).encode()


def json_push(fields: dict[str, object] | None = None, token: str | None = None) -> bytes:
    fields = push_fields() if fields is None else fields
    return json.dumps(fields | {"JWT": token_of(fields) if token is None else token}).encode()


def unsigned_token(fields: Mapping[str, object]) -> str:
    """A token whose header says that nobody signed it."""
    claims = {name: str(value) for name, value in fields.items()}
    return f"{_part({'alg': 'none'})}.{_part(claims)}."


def confused_token(fields: Mapping[str, object], pem: str) -> str:
    """A token signed by HMAC with the public key as its secret, which anybody can do."""
    claims = {name: str(value) for name, value in fields.items()}
    signed = f"{_part({'alg': 'HS256', 'typ': 'JWT'})}.{_part(claims)}"
    mac = hmac.new(pem.encode(), signed.encode(), hashlib.sha256).digest()
    return f"{signed}.{base64.urlsafe_b64encode(mac).rstrip(b'=').decode()}"


def _part(value: Mapping[str, str]) -> str:
    return base64.urlsafe_b64encode(json.dumps(value).encode()).rstrip(b"=").decode()
