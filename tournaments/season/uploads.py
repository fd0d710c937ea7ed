"""Submissions on their way in: pieces that are put together in memory, few at once, each for a bounded time. Without I/O."""

from dataclasses import dataclass, field
from hashlib import sha256

from arena.errors import InputError
from arena.protocol.messages import SeasonRequest
from arena.submission import PIECE_BYTES

IDLE_S = 20.0
"""How long an upload is kept whose next piece does not come."""
MOST_S = 600.0
"""How long one may take."""
SHARE = 4
"""As many of the largest submissions are held at once, or more that are smaller."""
_DIGEST_BYTES = 32


@dataclass(slots=True, kw_only=True)
class _Upload:
    digest: bytes
    n_bytes: int
    begun_at_s: float
    heard_at_s: float
    data: bytearray = field(default_factory=bytearray)


class Uploads:
    """What has come of each owner's submission; of a small one, whose only piece is all of it, nothing is held."""

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._uploads: dict[bytes, _Upload] = {}
        """By the owner's key."""

    @property
    def n_held_bytes(self) -> int:
        """Memory that is taken, or promised."""
        return sum(upload.n_bytes for upload in self._uploads.values())

    def receive(self, request: SeasonRequest, now_s: float) -> int | bytes | None:
        """Take a piece, whose sender was checked.

        Returns
        -------
        int | bytes | None
            Where the next piece begins; the whole submission, if this was the last; or None while others take all memory.

        Raises
        ------
        InputError
            The submission is too large, or what came is not what was announced.
        """
        self.forget_idle(now_s)
        n_bytes, piece = request.n_bytes, request.piece
        if n_bytes > self._most_bytes:
            raise InputError(f"the submission has {n_bytes:,} bytes, and this season takes {self._most_bytes:,}")
        is_possible = 0 <= request.offset < n_bytes and 0 < len(piece) <= min(PIECE_BYTES, n_bytes - request.offset)
        if not is_possible or len(request.digest) != _DIGEST_BYTES:
            raise InputError("the piece is no part of the submission that is announced with it; submit it again")
        upload = self._uploads.get(request.entry)
        if upload is None or (upload.digest, upload.n_bytes) != (request.digest, n_bytes):
            self._uploads.pop(request.entry, None)
            upload = _Upload(digest=request.digest, n_bytes=n_bytes, begun_at_s=now_s, heard_at_s=now_s)
        if request.offset != len(upload.data):
            return len(upload.data)  # it came before, or those before it are lost: the sender goes on from there
        if request.entry not in self._uploads and len(piece) < n_bytes:
            if self.n_held_bytes + n_bytes > SHARE * self._most_bytes:
                return None
            self._uploads[request.entry] = upload
        upload.data += piece
        upload.heard_at_s = now_s
        if len(upload.data) < n_bytes:
            return len(upload.data)
        self._uploads.pop(request.entry, None)
        if sha256(upload.data).digest() != upload.digest:
            raise InputError("what came is not what was announced; submit it again")
        return bytes(upload.data)

    def forget_idle(self, now_s: float) -> None:
        """Forget uploads that do not go on, or have taken too long."""
        self._uploads = {
            owner: upload
            for owner, upload in self._uploads.items()
            if now_s - upload.heard_at_s < IDLE_S and now_s - upload.begun_at_s < MOST_S
        }
