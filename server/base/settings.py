"""What a station process is told from outside: by the command line or the environment."""

from functools import cached_property
from ipaddress import ip_address, ip_network
from pathlib import Path
from typing import Literal, Self

import platformdirs
from pydantic import Field, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from autonomy.campaign import ClusterError, check_address

LINK_FOLDER = "links"
"""Folder below the data folder where the station's ends of simulated radios appear."""


class Settings(BaseSettings):
    """Settings of one station; every field is also an environment variable ``GRACE_<FIELD>``."""

    model_config = SettingsConfigDict(env_prefix="GRACE_", extra="ignore", frozen=True)

    data_dir: Path = Field(default_factory=lambda: Path(platformdirs.user_data_dir("grace")))
    """Folder of the database, the log files and the demo's clock."""
    camera_dir: Path | None = None
    """Folder below which cameras of kind ``folder:`` and ``video:`` find their pictures."""
    database_url: str | None = None
    """SQLAlchemy URL of the database; by default a SQLite file in the data folder."""
    host: str = "127.0.0.1"
    """Address to listen on; anything but loopback needs TLS or ``behind_proxy``."""
    port: int = Field(default=8000, ge=0, le=65535)
    """Port to listen on; 0 takes a free one."""
    tls_certificate: Path | None = None
    """PEM file of the certificate chain."""
    tls_key: Path | None = None
    """PEM file of the certificate's key."""
    behind_proxy: bool = False
    """A reverse proxy on this host or network speaks TLS to the browsers."""
    proxies: tuple[str, ...] = ("127.0.0.1", "::1")
    """Addresses or networks of that proxy: who asks is believed from these alone."""
    public_origins: tuple[str, ...] = ()
    """Origins that browsers see, such as ``https://station.example.org``, where they differ."""
    simulation: bool = False
    """The robots do not exist: every page and file is marked SIMULATION."""
    clock_file: Path | None = None
    """Anchors of a scaled clock that station and simulator share; none means real time."""
    demo_port: int | None = Field(default=None, ge=1, le=65535)
    """Loopback port at which the simulator takes faults to cause; none means that nobody can."""
    directip_host: str = "127.0.0.1"
    """Address on which DirectIP messages of robots are taken; the gateway must reach it."""
    directip_port: int | None = Field(default=None, ge=0, le=65535)
    """Port on which DirectIP messages of robots are taken; none means that nobody listens."""
    directip_allowed: tuple[str, ...] = ()
    """Networks from which DirectIP messages are taken, such as ``192.0.2.0/24``.

    None means those that reach ``directip_host``, which must then be of this machine alone."""
    gateway_public_url: str | None = None
    """How satellite gateways reach this station, such as ``https://station.example.org``."""
    session_hours: float = Field(default=12.0, gt=0)
    """How long a browser stays signed in."""
    oidc_issuer: str | None = None
    """Issuer of the provider of OpenID Connect that people may sign in by, exactly as it says."""
    oidc_client_id: str = ""
    """What the provider calls this station."""
    oidc_client_secret: SecretStr | None = None
    """The provider's secret of this station; none of a public client."""
    oidc_client_secret_file: Path | None = None
    """File that holds that secret, in its place."""
    oidc_title: str = "your organisation"
    """What stands on the button, after *Sign in with*."""
    oidc_roles: dict[str, Literal["none", "viewer", "pilot", "admin"]] = Field(
        default_factory=dict[str, Literal["none", "viewer", "pilot", "admin"]]
    )
    """Roles by ``group:NAME``, ``email:ADDRESS`` or ``*``; whoever has none may not sign in."""
    oidc_groups_claim: str = "groups"
    """Where the provider lists somebody's groups."""
    cluster: str = ""
    """Where studies are worked out (``autonomy.campaign``): a Dask scheduler such as
    ``tls://cluster.example.org:8786``, ``local`` or ``threads``; workers read it themselves."""
    token_requests_per_s: float = Field(default=100.0, gt=0.0, le=10_000.0)
    """How often a script may ask in a second, for each token."""
    token_burst: int = Field(default=1000, ge=1, le=100_000)
    """How many requests of a token may come at once, before the rate counts."""
    token_jobs: int = Field(default=20, ge=1, le=1000)
    """How many jobs and plans of a token may be under way at once."""
    clock_sync_expected: bool = True
    """Whether a clock that nothing keeps right is an alarm; not on a machine without a network."""
    log_format: Literal["text", "json"] = "text"
    """How lines look on the terminal; those of ``log/station.jsonl`` are JSON in any case."""
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    """From which level on something is logged."""
    log_limit_mb: float = Field(default=100.0, ge=1.0, le=100_000.0)
    """How large all files of ``log/station.jsonl`` become together; the oldest is dropped."""
    metrics_on_loopback: bool = False
    """Whoever asks from this machine reads ``/metrics`` without a token; not behind a proxy."""
    worker_processes: int = Field(default=2, ge=1, le=64)
    """How many planning runs and map fits may run at once."""

    @field_validator("directip_allowed", "proxies")
    @classmethod
    def _are_networks(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for network in value:
            ip_network(network)
        return value

    @field_validator("cluster")
    @classmethod
    def _is_a_cluster(cls, value: str) -> str:
        if value:
            try:
                check_address(value)
            except ClusterError as error:
                raise ValueError(str(error)) from error
        return value

    @model_validator(mode="after")
    def _is_safe_to_reach(self) -> Self:
        if (self.tls_certificate is None) != (self.tls_key is None):
            raise ValueError("tls_certificate and tls_key go together")
        if not self.is_loopback and not self.has_tls and not self.behind_proxy:
            raise ValueError(
                f"{self.host} can be reached from other machines: give tls_certificate and "
                "tls_key, or behind_proxy when a proxy speaks TLS, or listen on 127.0.0.1"
            )
        return self

    @model_validator(mode="after")
    def _knows_who_asks_for_metrics(self) -> Self:
        if self.metrics_on_loopback and self.behind_proxy:
            raise ValueError(
                "metrics_on_loopback does not go with behind_proxy: everybody comes from this "
                "machine then; give Prometheus a token"
            )
        return self

    @model_validator(mode="after")
    def _only_plays_in_a_simulation(self) -> Self:
        if self.demo_port is not None and not self.simulation:
            raise ValueError(
                "demo_port needs simulation: faults are caused in robots of a demo only"
            )
        return self

    @model_validator(mode="after")
    def _knows_who_may_deliver(self) -> Self:
        is_open = self.directip_port is not None and not _is_loopback(self.directip_host)
        if is_open and not self.directip_allowed:
            raise ValueError(
                f"directip_host {self.directip_host} can be reached from other machines, and "
                "DirectIP proves nothing: give directip_allowed the networks of the gateway"
            )
        return self

    @model_validator(mode="after")
    def _knows_its_provider(self) -> Self:
        if self.oidc_issuer is not None and not (self.oidc_client_id and self.oidc_roles):
            raise ValueError("oidc_issuer needs oidc_client_id, and oidc_roles of who may sign in")
        if self.oidc_client_secret is not None and self.oidc_client_secret_file is not None:
            raise ValueError("give oidc_client_secret or oidc_client_secret_file, not both")
        return self

    @property
    def oidc_secret(self) -> str | None:
        """The provider's secret of this station, from wherever it is kept."""
        if self.oidc_client_secret_file is not None:
            return self.oidc_client_secret_file.read_text().strip()
        secret = self.oidc_client_secret
        return None if secret is None else secret.get_secret_value()

    @property
    def has_tls(self) -> bool:
        """Whether the station itself speaks TLS."""
        return self.tls_certificate is not None

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach the station."""
        return _is_loopback(self.host)

    @property
    def secure_cookie(self) -> bool:
        """Whether browsers reach the station by TLS, so that the cookie may demand it."""
        return self.has_tls or self.behind_proxy

    @property
    def secret_dir(self) -> Path:
        """Folder of the station's secrets, which nobody but its user may read."""
        return self.data_dir / "secret"

    @cached_property
    def resolved_database_url(self) -> str:
        """URL of the database, with the default filled in."""
        if self.database_url is not None:
            return self.database_url
        return f"sqlite:///{(self.data_dir / 'station.sqlite3').resolve()}"


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False
