"""Where the console listens, and what other machines need before they may reach it."""

import logging
import os
import stat
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path

from steerlab.sim.errors import InvalidConfig

DEFAULT_PORT = 8765
SHORTEST_PASSWORD = 12
_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, slots=True)
class ConsoleConfig:
    """Where the console listens.

    Attributes:
        host: address or name to bind; anything but this machine itself needs all that follows.
        port: 0 takes any free one.
        password_file: its first line is the experimenter's password.
        tls_cert, tls_key: PEM files.

    Raises:
        InvalidConfig: it would be open to the network unprotected, or to every address at once.
    """

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    allow_network: bool = False
    password_file: Path | None = None
    tls_cert: Path | None = None
    tls_key: Path | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.port <= 65535:
            raise InvalidConfig(f"port is {self.port}; it must be from 0 to 65535.")
        if (self.tls_cert is None) != (self.tls_key is None):
            given = "tls-cert" if self.tls_cert else "tls-key"
            raise InvalidConfig(f"--{given} stands alone; --tls-cert and --tls-key go together.")
        if is_loopback(self.host):
            return
        if is_wildcard(self.host):
            raise InvalidConfig(
                f"host is {self.host!r}, which is every address of this machine; name the one "
                "by which the tablet reaches it, such as --host 192.168.1.20."
            )
        given = {
            "--allow-network": self.allow_network,
            "--password-file": self.password_file is not None,
            "--tls-cert and --tls-key": self.tls_cert is not None,
        }
        lacking = [option for option, there in given.items() if not there]
        if lacking:
            raise InvalidConfig(
                f"host is {self.host!r}, which other machines can reach; that also needs "
                f"{', '.join(lacking)}. Without --host the console serves this machine alone."
            )

    @property
    def scheme(self) -> str:
        """``https`` with TLS files."""
        return "https" if self.tls_cert else "http"

    def password(self) -> str | None:
        """What the password file holds; None without one.

        On Windows nobody checks who else may read the file; a warning says so.

        Raises:
            InvalidConfig: others may read the file, it cannot be read, or the password is short.
        """
        path = self.password_file
        if path is None:
            return None
        try:
            _refuse_if_others_may_read(path)
            lines = path.read_text("utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise InvalidConfig(f"Cannot read the password file {path}: {error}.") from error
        password = lines[0].strip() if lines else ""
        if len(password) < SHORTEST_PASSWORD:
            raise InvalidConfig(
                f"The password in {path} has {len(password)} characters; "
                f"write one of at least {SHORTEST_PASSWORD} into its first line."
            )
        return password

    def check_tls_key(self) -> None:
        """Refuse a TLS key that others may read, in a file of its own or with its certificate.

        Raises:
            InvalidConfig: they may, or a file cannot be read.
        """
        if self.tls_key is None or self.tls_cert is None:
            return
        try:
            _refuse_if_others_may_read(self.tls_key)
            if b"PRIVATE KEY" in self.tls_cert.read_bytes():
                _refuse_if_others_may_read(self.tls_cert)
        except OSError as error:
            raise InvalidConfig(
                f"Cannot read {error.filename}: {error.strerror}; "
                "name a PEM certificate and its key."
            ) from error

    def origins(self, port: int) -> tuple[str, ...]:
        """``scheme://host:port`` of each address that the pages are opened by.

        Args:
            port: the one that was bound.
        """
        names = ("127.0.0.1", "localhost", "::1") if is_loopback(self.host) else (self.host,)
        if is_loopback(self.host) and self.host.lower() not in names:
            names = (*names, self.host)
        shown = [f"[{name}]" if ":" in name else name.lower() for name in names]
        usual = {"http": 80, "https": 443}[self.scheme]
        suffix = "" if port == usual else f":{port}"
        return tuple(f"{self.scheme}://{name}{suffix}" for name in shown)

    def address(self, port: int) -> str:
        """The address to tell people."""
        host = f"[{self.host}]" if ":" in self.host else self.host.lower()
        return next(
            origin for origin in self.origins(port) if origin.split("//")[1].startswith(host)
        )


def _refuse_if_others_may_read(path: Path) -> None:
    mode = path.stat().st_mode
    if not hasattr(os, "geteuid"):  # Windows has lists of who may read, which a mode does not show
        _log.warning("who else may read %s is not checked on this system; see its properties", path)
    elif mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise InvalidConfig(f"Others may read {path}; run: chmod 600 {path}")


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach ``host``."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def is_wildcard(host: str) -> bool:
    """Whether ``host`` stands for every address of this machine."""
    try:
        return ip_address(host).is_unspecified
    except ValueError:
        return host.strip() in ("", "*")
