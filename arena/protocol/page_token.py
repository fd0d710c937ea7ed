"""What opens the owner's view of an entry on a season's web page: a token that the entry's key signed, which ends by itself.

    public key (32 bytes) | expiry, seconds since 1970 (8 bytes, big endian) | signature (64 bytes)

as 139 letters, digits, - and _. The signature is of the expiry and the season's name, so that it opens no other season. Whoever
has it can read what its owner reads, and can say nothing in the owner's name.
"""

import base64
import binascii

from arena.errors import ForgedError
from arena.protocol.identity import PUBLIC_BYTES, SIGNATURE_BYTES, Identity, to_text, verify

TOKEN_S = 7 * 86_400
"""How long a token opens a page."""
TOKEN_HEADER = "arena-token"
"""Of the request in which a page sends it: it stands in no address."""
_LABEL = "season page"
_EXPIRY_BYTES = 8


def make_page_token(identity: Identity, season: str, now_s: float) -> str:
    """Return a token that opens the owner's view of an entry whose key this is; `now_s` is in seconds since 1970."""
    expiry = (int(now_s) + TOKEN_S).to_bytes(_EXPIRY_BYTES, "big")
    signature = identity.sign(_LABEL, expiry + season.encode())
    return base64.urlsafe_b64encode(identity.public + expiry + signature).decode().rstrip("=")


def page_link(page: str, season: str, entry: str, token: str) -> str:
    """Return the link that opens the owner's view; `page` is the web page's address, as in http://127.0.0.1:8000.

    A browser keeps what stands behind # to itself: the token gets into no log.
    """
    return f"{page.rstrip('/')}/seasons/{season}/{entry}#token={token}"


def read_page_token(token: str, season: str, now_s: float) -> str:
    """Return the public key, as text, whose owner a token lets in.

    Raises
    ------
    ForgedError
        It is no token, of another season, changed, or its time is over.
    """
    try:
        data = base64.b64decode(token + "=" * (-len(token) % 4), altchars=b"-_", validate=True)
    except (binascii.Error, ValueError):
        data = b""
    if len(data) != PUBLIC_BYTES + _EXPIRY_BYTES + SIGNATURE_BYTES or to_text(data) != token:
        raise ForgedError("this is no token of a season's page")
    public, expiry, signature = data[:PUBLIC_BYTES], data[PUBLIC_BYTES:-SIGNATURE_BYTES], data[-SIGNATURE_BYTES:]
    verify(public, _LABEL, expiry + season.encode(), signature)
    if int.from_bytes(expiry, "big") <= now_s:
        raise ForgedError("the time of this token is over")
    return to_text(public)
