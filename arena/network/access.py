"""What a router lets clients do, and the certificates by which clients know the router."""

import ssl
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cryptography.x509 import BasicConstraints, ExtensionNotFound, load_pem_x509_certificate

from arena.errors import InputError
from arena.protocol import topics


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """What a pit presents to clients that connect by TLS: two PEM files."""

    certificate: Path
    """The chain, the pit's own certificate first; its names must hold the host that clients connect to."""
    key: Path
    """The private key, without a password."""


def check_certificate(given: Certificate) -> None:
    """Refuse, with a reason, what Zenoh would refuse without one."""
    for path in (given.certificate, given.key):
        _check_readable(path)
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(given.certificate, given.key, password="")
    except ssl.SSLError as error:
        why = "the key belongs to another certificate" if error.reason == "KEY_VALUES_MISMATCH" else "they must be PEM files"
        if b"ENCRYPTED" in given.key.read_bytes():
            why = "the key is locked by a password, which nobody here can type"
        raise InputError(f"{given.certificate} and {given.key} are no certificate and its private key: {why}") from error
    if _is_of_authority(given.certificate):
        raise InputError(
            f"{given.certificate} is the certificate of an authority, which no client takes for a pit's; make it with "
            "CA:FALSE, as by openssl req -x509 -addext basicConstraints=critical,CA:FALSE"
        )


def _is_of_authority(chain: Path) -> bool:
    try:
        constraints = load_pem_x509_certificate(chain.read_bytes()).extensions.get_extension_for_class(BasicConstraints)
    except ExtensionNotFound:
        return False
    except ValueError as error:  # what OpenSSL takes all the same
        raise InputError(f"the certificate {chain} cannot be used: {error}") from error
    return constraints.value.ca


def check_authority(path: Path) -> None:
    """Refuse what Zenoh would take for a pit that does not answer."""
    _check_readable(path)
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT).load_verify_locations(path)
    except ssl.SSLError as error:
        raise InputError(f"{path} holds no certificate; it must be a PEM file") from error


def _check_readable(path: Path) -> None:
    try:
        path.open("rb").close()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error


WORKERS_PROTOCOL = "unixsock-stream"
"""How the workers of a pit connect to its router, and nobody else: in a folder that is the pit's own."""
_EVERYTHING = [
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable", "liveliness_token", "liveliness_query",
    "declare_liveliness_subscriber",
]  # fmt: skip


def access_rules(pit: str, *, for_players: bool = True, has_workers: bool = False) -> dict[str, Any]:
    """Return the rules for whoever connects, to play or only to watch: what is not allowed here is denied.

    Workers may do anything. A key expression is allowed where a rule's includes all of it, so `**` is refused as a whole. What
    leaves the router must be allowed too: a client sends nothing until it knows that somebody subscribes to its publisher's key.
    """
    queried = [topics.join(pit), topics.lobby(pit), topics.all_journals(pit)]
    published = [topics.all_public(pit), topics.all_truths(pit), topics.all_delayed(pit)]
    allowed = {}
    if for_players:
        queried.append(topics.submissions(pit))
        published.append(topics.all_observations(pit))
        allowed = {
            "publish orders": ("ingress", ["put"], [topics.all_actions(pit)]),
            "learn of subscribers": ("egress", ["declare_subscriber"], [topics.all_actions(pit)]),
            "declare presence": ("ingress", ["liveliness_token"], [topics.all_presence(pit)]),
        }
    allowed |= {
        "query": ("ingress", ["query"], queried),
        "receive replies": ("egress", ["declare_queryable", "reply"], queried),
        "subscribe": ("ingress", ["declare_subscriber"], published),
        "receive samples": ("egress", ["put"], published),
    }
    rules: dict[str, Any] = {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            {"id": what, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys}
            for what, (flow, messages, keys) in allowed.items()
        ],
        "subjects": [{"id": "whoever connects"}],
        "policies": [{"rules": list(allowed), "subjects": ["whoever connects"]}],
    }
    if has_workers:
        anything = {"id": "do anything", "permission": "allow", "flows": ["ingress", "egress"], "messages": _EVERYTHING}
        rules["rules"].append({**anything, "key_exprs": ["**"]})
        rules["subjects"].append({"id": "workers", "link_protocols": [WORKERS_PROTOCOL]})
        rules["policies"].append({"rules": ["do anything"], "subjects": ["workers"]})
    return rules
