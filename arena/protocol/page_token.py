"""What opens the owner's view of an entry on a season's web page: a token that the entry's key signed, which ends by itself.

    public key (32 bytes) | expiry, seconds since 1970 (8 bytes, big endian) | signature (64 bytes)

as 139 letters, digits, - and _. The signature is of the expiry, the web page's host and the season's name, so that it opens no
other season: one that has its authors' links lead to a page of its own gets nothing that opens another's. Whoever has the token
can read what the owner reads, and can say nothing in the owner's name.
"""

import base64
import binascii
from urllib.parse import urlsplit

from arena.errors import ForgedError
from arena.protocol.identity import PUBLIC_BYTES, SIGNATURE_BYTES, Identity, to_text, verify

TOKEN_S = 7 * 86_400
"""How long a token opens a page."""
TOKEN_HEADER = "arena-token"
"""Of the request in which a page sends it: it stands in no address."""
_LABEL = "season page"
_EXPIRY_BYTES = 8
_USUAL_PORTS = {"http": ":80", "https": ":443"}


def make_page_link(identity: Identity, page: str, season: str, entry: str, now_s: float) -> str:
    """Return the link that opens the owner's view of an entry, with its token behind #: a browser keeps that part to itself.

    Parameters
    ----------
    identity
        The entry's key.
    page
        Address of the web page, as in http://127.0.0.1:8000.
    now_s
        Seconds since 1970.
    """
    token = make_page_token(identity, _host_of(page), season, now_s)
    return f"{page.rstrip('/')}/seasons/{season}/{entry}#token={token}"


def make_page_token(identity: Identity, host: str, season: str, now_s: float) -> str:
    """Return a token that opens the owner's view of an entry; `host` is that of the web page, as a browser sends it."""
    expiry = (int(now_s) + TOKEN_S).to_bytes(_EXPIRY_BYTES, "big")
    signature = identity.sign(_LABEL, _signed(expiry, host, season))
    return base64.urlsafe_b64encode(identity.public + expiry + signature).decode().rstrip("=")


def read_page_token(token: str, host: str, season: str, now_s: float) -> str:
    """Return the public key, as text, whose owner a token lets in.

    Raises
    ------
    ForgedError
        It is no token, of another page or season, changed, or its time is over.
    """
    try:
        data = base64.b64decode(token + "=" * (-len(token) % 4), altchars=b"-_", validate=True)
    except (binascii.Error, ValueError):
        data = b""
    if len(data) != PUBLIC_BYTES + _EXPIRY_BYTES + SIGNATURE_BYTES or to_text(data) != token:
        raise ForgedError("this is no token of a season's page")
    public, expiry, signature = data[:PUBLIC_BYTES], data[PUBLIC_BYTES:-SIGNATURE_BYTES], data[-SIGNATURE_BYTES:]
    verify(public, _LABEL, _signed(expiry, host, season), signature)
    if int.from_bytes(expiry, "big") <= now_s:
        raise ForgedError("the time of this token is over")
    return to_text(public)


def _signed(expiry: bytes, host: str, season: str) -> bytes:
    return expiry + host.lower().encode("utf-8", "surrogateescape") + b"\0" + season.encode("utf-8", "surrogateescape")


def _host_of(page: str) -> str:
    """Return what a browser sends as Host when it asks for a page."""
    parts = urlsplit(page)
    return parts.netloc.rpartition("@")[2].removesuffix(_USUAL_PORTS.get(parts.scheme, " "))
