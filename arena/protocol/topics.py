"""The Zenoh keys of a pit. A chunk is letters, digits, - and _, so that no name can reach into another's key."""

import re
from functools import lru_cache

from arena.errors import InputError, UnreadableError
from arena.game.types import Team

_CHUNK = re.compile(r"[A-Za-z0-9_-]{1,64}")
_LABEL = re.compile(r"[A-Za-z0-9_-]{1,64}(\.[1-9][0-9]{0,5})?")
_LANE = re.compile(r"[0-9]{1,6}")
LANES_OF_WORKER = 10_000
MOST_WORKERS = 64
"""So that the number of each lane has six digits."""
_NAMES: dict[Team | None, str] = {None: "all"} | {team: team.name.lower() for team in Team}
"""Behind a lane: a seat of a match, or all that goes in bundles."""
_TEAMS = {name: team for team, name in _NAMES.items()}


def check_chunk(what: str, chunk: str) -> str:
    """Return `chunk`, or refuse it."""
    if not _CHUNK.fullmatch(chunk):
        raise InputError(f"{what} is {chunk!r}; it must be 1 to 64 letters, digits, - or _")
    return chunk


def is_chunk(chunk: str) -> bool:
    """Whether `chunk` can be a part of a key."""
    return _CHUNK.fullmatch(chunk) is not None


def check_label(what: str, label: str) -> str:
    """Return the label of an entry's version, such as `mine` or `mine.2`, or refuse it."""
    if not is_label(label):
        raise InputError(
            f"{what} is {label!r}; it must be 1 to 64 letters, digits, - or _, and may end in a version, as in mine.2"
        )
    return label


def is_label(label: str) -> bool:
    """Whether a player can be called so: a chunk, and behind a dot the number of a version."""
    return _LABEL.fullmatch(label) is not None


def join(pit: str) -> str:
    """Return the key of the queryable that hands out seats."""
    return f"arena/{pit}/join"


def lobby(pit: str) -> str:
    """Return the key of the queryable that tells the pit's public facts."""
    return f"arena/{pit}/lobby"


def submissions(pit: str) -> str:
    """Return the key of the queryable that takes submissions to a season, and tells their owners how they stand."""
    return f"arena/{pit}/submissions"


def observation(pit: str, lane: int, team: Team | None) -> str:
    """Return the key on which a seat hears the referee, or that of a lane of bundles, which is no team's.

    It is its lane's, since Zenoh keeps each key that it was ever told.
    """
    return f"arena/{pit}/lane/{lane}/{_NAMES[team]}/observation"


def all_observations(pit: str) -> str:
    """Return the expression of every seat's observation key."""
    return f"arena/{pit}/lane/*/*/observation"


def action(pit: str, lane: int, team: Team | None) -> str:
    """Return the key on which the referee hears a seat, or a lane of bundles."""
    return f"arena/{pit}/lane/{lane}/{_NAMES[team]}/action"


def all_actions(pit: str) -> str:
    """Return the expression of every seat's action key."""
    return f"arena/{pit}/lane/*/*/action"


def lanes_of_worker(worker: int) -> range:
    """Return the lanes of a worker, from 1 on: of those of a pit with workers, the first two digits say whose each is."""
    first = 100_000 + LANES_OF_WORKER * (worker - 1)
    return range(first, first + LANES_OF_WORKER)


def actions_of_worker(pit: str, worker: int) -> str:
    """Return the expression of the action keys of a worker's lanes, and of its beat."""
    return f"arena/{pit}/lane/{lanes_of_worker(worker).start // LANES_OF_WORKER}$*/*/action"


def beat_of_worker(pit: str, worker: int) -> str:
    """Return the key on which a pit wakes a worker."""
    return f"arena/{pit}/lane/{lanes_of_worker(worker).start // LANES_OF_WORKER}beat/blue/action"


def beat(pit: str) -> str:
    """Return the key on which a referee wakes itself: an action of no lane, heard with all the others."""
    return f"arena/{pit}/lane/beat/blue/action"


@lru_cache(maxsize=1_024)
def read_action(key: str) -> tuple[int, Team | None]:
    """Return the lane and the team of an action key; no team of a lane of bundles."""
    parts = key.split("/")
    if len(parts) != 6 or parts[4] not in _TEAMS or not _LANE.fullmatch(parts[3]):
        raise UnreadableError(f"{key} is no seat's key")
    return int(parts[3]), _TEAMS[parts[4]]


def read_match(key: str) -> str:
    """Return the match of any key of one."""
    parts = key.split("/")
    if len(parts) < 5:
        raise UnreadableError(f"{key} is no key of a match")
    return parts[3]


def public(pit: str, match: str) -> str:
    """Return the key of what everyone may know of a match."""
    return f"arena/{pit}/match/{match}/public"


def all_public(pit: str) -> str:
    """Return the expression of every match's public key."""
    return f"arena/{pit}/match/*/public"


def truth(pit: str, match: str) -> str:
    """Return the key of a running match's true state, sealed to spectators who have the key."""
    return f"arena/{pit}/match/{match}/truth"


def all_truths(pit: str) -> str:
    """Return the expression of every match's truth key."""
    return f"arena/{pit}/match/*/truth"


def delayed(pit: str, match: str) -> str:
    """Return the key of a running match's true state as it was some ticks ago, where the pit shows that to everyone."""
    return f"arena/{pit}/match/{match}/delayed"


def all_delayed(pit: str) -> str:
    """Return the expression of every match's delayed key."""
    return f"arena/{pit}/match/*/delayed"


def journal(pit: str, match: str) -> str:
    """Return the key of a match's journal, once it may be seen."""
    return f"arena/{pit}/journal/{match}"


def all_journals(pit: str) -> str:
    """Return the expression of every journal's key."""
    return f"arena/{pit}/journal/*"


def read_journal(key: str) -> str:
    """Return the match of a journal's key."""
    return key.rsplit("/", 1)[-1]


def presence(pit: str, name: str, client: str) -> str:
    """Return the liveliness key of a client process."""
    return f"arena/{pit}/presence/{name}/{client}"


def all_presence(pit: str) -> str:
    """Return the expression of every client's liveliness key."""
    return f"arena/{pit}/presence/*/*"


def read_presence(key: str) -> str:
    """Return the client of a liveliness key."""
    return key.rsplit("/", 1)[-1]
