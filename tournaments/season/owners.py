"""What the owner of an entry may ask of a season, and what is answered: uploads, how it stands, its log, its versions.

Whoever asks has signed it. A name belongs to the first key that submitted something under it which was taken.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from hashlib import sha256
from os import SEEK_END
from pathlib import Path
from typing import Any

from arena.console import quantity
from arena.errors import InputError
from arena.pit.register import Register
from arena.protocol.identity import from_text, is_public_key, to_text
from arena.protocol.messages import Message, Refusal, SeasonAnswer, SeasonRequest, Wait
from arena.protocol.topics import is_chunk
from arena.submission import unpack
from tournaments.league.entries import REMOTE
from tournaments.league.season import SeasonTerms, most_name_letters
from tournaments.season.status import summarise, tell_match, tell_submission
from tournaments.season.submitted import SubmittedFolder
from tournaments.season.uploads import Uploads
from tournaments.store.season_store import ACCEPTED, WAITING, SeasonEntry, SeasonStore, Submission
from tournaments.store.store import StoredLeague

logger = logging.getLogger(__name__)
_DAY_S = 86_400.0
_MOST_OF_A_DAY = 100_000
_MOST_ROLL_BACKS, _ROLL_BACKS_S = 5, 60.0
"""Of one entry in so long: each has everybody rated anew."""
_LOG_PIECE_BYTES, _MOST_LOG_BYTES = 40_000, 200_000
_MOST_WAITING = 500
"""Submissions that wait for their check at once; and no more bytes than `_MOST_WAITING_LARGE` of the largest have."""
_MOST_WAITING_LARGE = 50
_MOST_SUBMISSIONS, _MOST_VERSIONS, _MOST_MATCHES = 10, 50, 10
"""Of those that an owner is told of, the last."""


class OwnerRequests:
    """Answers the owners of a season's entries.

    Parameters
    ----------
    logs
        Folder of the logs of those that play, LABEL.log.
    register
        The invites of the season, and who used them.
    clock
        Seconds since 1970.
    on_submission
        Called when something waits for its check.
    describe
        Returns what else the season tells the owner of an entry: its place in the table, its page, where it joins.
    why_not_remote
        Why no entry may play from its owner's machine; nothing if it may.
    """

    def __init__(
        self,
        store: SeasonStore,
        league: StoredLeague,
        terms: SeasonTerms,
        folder: SubmittedFolder,
        logs: Path,
        register: Register,
        *,
        clock: Callable[[], float],
        on_submission: Callable[[], None],
        describe: Callable[[SeasonEntry], Mapping[str, Any]] = lambda _: {},
        why_not_remote: str = "",
    ) -> None:
        self._store, self._league, self._terms, self._folder, self._logs = store, league, terms, folder, logs
        self._register, self._clock, self._describe = register, clock, describe
        self._why_not_remote = why_not_remote
        self._on_submission = on_submission
        self._most_bytes = terms.most_kb * 1_000
        self._rolled_back_at_s: dict[str, list[float]] = {}
        self._uploads = Uploads(self._most_bytes)
        self._commands: dict[str, Callable[[SeasonRequest, float], Message]] = {
            "upload": self._upload,
            "remote": self._play_remotely,
            "status": self._tell_status,
            "log": self._tell_log,
            "roll-back": self._roll_back,
            "withdraw": self._withdraw,
        }

    @property
    def n_held_bytes(self) -> int:
        """Memory that uploads take, or were promised."""
        return self._uploads.n_held_bytes

    def answer(self, request: SeasonRequest, now_s: float) -> Message:
        """Do what is asked for, or say why not; `now_s` is of a clock that never goes back.

        Raises
        ------
        ArenaError
            The store cannot be reached, or a file cannot be written: it may be asked again.
        """
        command = self._commands.get(request.command)
        try:
            if command is None:
                raise InputError(f"there is no command {request.command!r}; it is one of {', '.join(self._commands)}")
            if not is_chunk(request.name):
                raise InputError("an entry's name is 1 to 64 letters, digits, - or _; choose one with --name")
            return command(request, now_s)
        except InputError as error:
            return Refusal(reason=str(error))

    # Submitting

    def _upload(self, request: SeasonRequest, now_s: float) -> Message:
        self._check_may_submit(request)
        came = self._uploads.receive(request, now_s)
        if came is None:
            return Wait(reason="others submit much just now")
        if isinstance(came, int):
            return SeasonAnswer(text="more is to come", offset=came)
        try:
            unpack(came, self._most_bytes)
            self._check_is_new(request.name, request.digest.hex())
        except InputError as error:
            logger.info("a submission of %s was not taken: %s", request.name, error)
            raise
        try:
            digest = self._folder.keep(request.name, came)
        except OSError as error:
            logger.warning("a submission cannot be kept: %s", error)
            return Wait(reason="the season has no room on its disk; its organiser was told")
        kept = self._submit(request, digest, len(came))
        self._on_submission()
        n_before = self._store.queue_position(self._league, kept) - 1
        after = f" after {quantity(n_before, 'other')}" if n_before else ""
        return SeasonAnswer(text=f"it waits for its check{after}", offset=len(came), facts={"submission": kept.id})

    def _play_remotely(self, request: SeasonRequest, now_s: float) -> Message:
        if self._why_not_remote:
            raise InputError(self._why_not_remote)
        self._check_may_submit(request)
        spec = REMOTE + to_text(request.entry)
        digest = sha256(spec.encode()).hexdigest()
        self._check_is_new(request.name, digest)
        kept = self._submit(request, digest, 0, ACCEPTED)
        version = self._store.accept(
            self._league, kept, spec=spec, says="it plays from its owner's machine", report=None, now_s=self._clock()
        )
        entry = self._store.find_entry(self._league, request.name)
        join = "" if entry is None else self._describe(entry).get("join", "")
        text = f"version {version.number} of {request.name} plays as soon as it joins"
        return SeasonAnswer(text=text, facts={"join": join} if join else {})

    def _submit(self, request: SeasonRequest, digest: str, n_bytes: int, state: str = WAITING) -> Submission:
        return self._store.submit(
            self._league, entry=request.name, owner=to_text(request.entry), digest=digest, n_bytes=n_bytes, now_s=self._clock(),
            state=state,
        )  # fmt: skip

    def _check_may_submit(self, request: SeasonRequest) -> None:
        """Refuse whoever may not submit under this name, or not now; tie the invite to who used it."""
        self._check_is_open()
        owner, name, terms = to_text(request.entry), request.name, self._terms
        if is_public_key(name):
            raise InputError("a name must not look like a public key; choose another with --name")
        if len(name) > (most := most_name_letters(self._league.name)):
            raise InputError(f"the name {name} is too long; in this season, it may have {most} letters: choose one with --name")
        self._check_invite(request)
        waiting = self._store.submissions(self._league, state=WAITING)
        entries = self._store.entries(self._league)
        owners = {one.owner for one in entries if one.entry == name} | {one.owner for one in waiting if one.entry == name}
        if owners - {owner}:
            raise InputError(f"the name {name} belongs to another key; choose one with --name")
        if any(one.entry == name for one in waiting):
            raise InputError(f"a version of {name} waits for its check; submit the next when that has ended")
        self._check_has_room(request, entries, waiting)
        if len(waiting) >= _MOST_WAITING or sum(one.n_bytes for one in waiting) > _MOST_WAITING_LARGE * self._most_bytes:
            raise InputError(f"{len(waiting)} submissions wait for their checks; come again later")
        since_s = self._clock() - _DAY_S
        today = self._store.submissions(self._league, since_s=since_s, most=_MOST_OF_A_DAY)
        if sum(self.owner_of(one.owner) == self.owner_of(owner) for one in today) >= terms.per_day:
            raise InputError(
                f"the season takes {quantity(terms.per_day, 'submission')} of one owner in 24 hours; come again later"
            )

    def owner_of(self, key: str) -> str:
        """Return what tells whose a key is: the same for keys whose invite codes have one owner."""
        return self._register.owner_of(from_text(key)) if key else key

    def _check_has_room(self, request: SeasonRequest, entries: Sequence[SeasonEntry], waiting: Sequence[Submission]) -> None:
        """Refuse one entry more of an owner than the season takes."""
        owner, most = self.owner_of(to_text(request.entry)), self._terms.entries_per_owner
        own = {one.entry for one in entries if self.owner_of(one.owner) == owner and not one.is_withdrawn}
        own |= {one.entry for one in waiting if self.owner_of(one.owner) == owner}
        if request.name not in own and len(own) >= most:
            raise InputError(
                f"the season takes {quantity(most, 'entry', 'entries')} of one owner, and you have {', '.join(sorted(own))}; "
                "submit a new version with --name, or --withdraw one first"
            )

    def _check_is_open(self) -> None:
        deadline_s = self._terms.deadline_s
        if deadline_s is not None and not self._terms.is_open(self._clock()):
            raise InputError(f"the deadline was {_format_time(deadline_s)}; what comes after it is not taken")

    def _check_invite(self, request: SeasonRequest) -> None:
        register = self._register
        if not register.needs_invite or (not request.invite and register.has_invited(request.entry)):
            return
        if not request.invite:
            raise InputError("this season wants an invite code; submit with --invite CODE")
        refusal = register.object_to(request)
        if refusal:
            raise InputError(refusal.replace("this pit's", "this season's"))
        register.admit(request)
        register.save()

    def _check_is_new(self, name: str, digest: str) -> None:
        """Refuse what the entry has played."""
        played = next((one for one in self._store.versions(self._league, name) if one.fingerprint == digest), None)
        if played is None:
            return
        entry = self._store.find_entry(self._league, name)
        if entry is not None and entry.number == played.number and not entry.is_withdrawn:
            raise InputError(f"this is version {played.number} of {name}, which plays already")
        raise InputError(f"this was version {played.number} of {name}; to play it again: --roll-back {played.number}")

    # What the owner of an entry alone may ask for

    def _tell_status(self, request: SeasonRequest, now_s: float) -> Message:
        entry = self._find_own(request)
        owner = to_text(request.entry)
        last = [one for one in self._store.submissions(self._league, entry=request.name, most=100) if one.owner == owner]
        facts: dict[str, Any] = {
            "season": self._league.name,
            "entry": request.name,
            "plays": None if entry is None or entry.is_withdrawn else entry.number,
            "queue": next((self._store.queue_position(self._league, one) for one in last if one.state == WAITING), None),
            "submissions": [tell_submission(one) for one in last[-_MOST_SUBMISSIONS:]],
            "report": last[-1].report if last else None,
        }
        if entry is not None:
            versions = self._store.versions(self._league, request.name)[-_MOST_VERSIONS:]
            labels = [one.label for one in versions]
            played = self._store.matches_of(self._league, labels, _MOST_MATCHES) if labels else []
            facts |= {
                "versions": [
                    {"number": one.number, "entered_at": one.entered_at, "rating": None if one.rating is None else {**one.rating}}
                    for one in versions
                ],
                "matches": [tell_match(one, request.name) for one in played],
                **self._describe(entry),
            }
        return SeasonAnswer(text=summarise(facts), facts=facts)

    def _tell_log(self, request: SeasonRequest, now_s: float) -> Message:
        entry = self._find_own(request)
        file = None if entry is None else self._logs / f"{entry.label}.log"
        if file is None or not file.is_file():
            return SeasonAnswer(text=f"{request.name} has no log yet")
        try:
            with file.open("rb") as log:
                end = log.seek(0, SEEK_END)
                log.seek(min(max(request.offset, 0, end - _MOST_LOG_BYTES), end))
                data = log.read(_LOG_PIECE_BYTES)
                return SeasonAnswer(text=file.name, offset=log.tell(), data=data)
        except OSError as error:
            raise InputError(f"the log of {request.name} cannot be read: {error.strerror}") from error

    def _roll_back(self, request: SeasonRequest, now_s: float) -> Message:
        entry = self._find_playing(request)
        self._check_is_open()
        numbers = [one.number for one in self._store.versions(self._league, request.name)]
        if request.number not in numbers:
            raise InputError(f"{request.name} has no version {request.number}; it has {', '.join(map(str, numbers))}")
        self._check_has_room(request, self._store.entries(self._league), self._store.submissions(self._league, state=WAITING))
        lately_s = [at_s for at_s in self._rolled_back_at_s.get(request.name, ()) if now_s - at_s < _ROLL_BACKS_S]
        if len(lately_s) >= _MOST_ROLL_BACKS:
            raise InputError(f"{request.name} has gone to another version {len(lately_s)} times in a minute; try again in one")
        self._rolled_back_at_s[request.name] = [*lately_s, now_s]
        self._store.play_version(self._league, entry, request.number)
        return SeasonAnswer(text=f"version {request.number} of {request.name} plays from now on")

    def _withdraw(self, request: SeasonRequest, now_s: float) -> Message:
        self._find_own(request)
        for one in self._store.submissions(self._league, state=WAITING, owner=to_text(request.entry), entry=request.name):
            self._store.refuse(self._league, one, "it was withdrawn")
            self._folder.forget(one.entry, one.digest)
        entry = self._find_own(request)  # what was checked meanwhile may have been accepted before it was refused
        if entry is not None and not entry.is_withdrawn:
            self._store.withdraw(self._league, entry)
        return SeasonAnswer(text=f"{request.name} plays no more; what it played stays, and --roll-back N brings it back")

    def _find_own(self, request: SeasonRequest) -> SeasonEntry | None:
        """Return the entry of this name that is the sender's; None if it never played and its submissions are the sender's."""
        entry = self._store.find_entry(self._league, request.name)
        owner = to_text(request.entry)
        if entry is None and self._store.submissions(self._league, entry=request.name, owner=owner, most=1):
            return None
        if entry is None or entry.owner != owner:
            raise InputError(f"you have no entry {request.name} in this season; name yours with --name, and its key with --key")
        return entry

    def _find_playing(self, request: SeasonRequest) -> SeasonEntry:
        entry = self._find_own(request)
        if entry is None:
            raise InputError(f"no version of {request.name} has been accepted yet")
        return entry


def _format_time(at_s: float) -> str:
    return datetime.fromtimestamp(at_s, UTC).strftime("%Y-%m-%d %H:%M UTC")
