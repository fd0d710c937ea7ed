"""The venue `network`: the real pit, a referee and every entry a process of its own, Zenoh between them."""

import time
from collections import Counter, deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace

from arena.folders import data_folder
from arena.game.types import Team
from arena.keyring.files import load_or_make
from arena.network.address import Address, free_port
from arena.records.journal import journal_name
from arena.records.plan import MatchPlan
from tournaments.outcome import Outcome
from tournaments.venues.bundle import freeze
from tournaments.venues.client_pool import ClientPool
from tournaments.venues.fork_server import ForkServer, can_fork
from tournaments.venues.processes import entry_key_path, may_fork
from tournaments.venues.recovery import find_ended
from tournaments.venues.referee_process import MOST_PLANS, Addition, Call, Done, Finish, News, RefereeProcess, Withdrawal
from tournaments.venues.setting import EntryLostError, Fighter, VenueSetting, check_plans, ignore_invitations

_PIT = "league"
_SETTLE_S = 2.0
_POLL_S = 0.2


def address_of(setting: VenueSetting) -> Address:
    """Return where the pit of a league is, in the venue `network`."""
    pit = load_or_make(setting.keys / "pit.key")
    return Address(endpoint=setting.listen or f"tcp/127.0.0.1:{free_port()}", pit=_PIT, fingerprint=pit.fingerprint)


def invitations(setting: VenueSetting, address: Address) -> dict[str, str]:
    """Return the command with which each entry joins that comes by itself."""
    return {name: f"arena join '{address}' --name {name} --key FILE --slots {setting.slots} --forever" for name in setting.remote}


def play(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """Play over Zenoh, on loopback. A void match is told of, and not played again here.

    Raises
    ------
    ArenaError
        The referee, or the process that clients are forked from, died again and again; a log says why.
    EntryLostError
        A client died again and again and played no match, or an entry that joins by itself has not come for `setting.absence_s`.
    """
    left = {plan.identity: plan for plan in plans}
    for outcome in find_ended(setting.journals, setting.ruleset, plans):
        del left[outcome.identity]
        yield outcome
    if not left:
        return
    names = {name for plan in left.values() for name in (plan.blue, plan.red)}
    entries = {name: spec for name, spec in setting.entries.items() if name in names}
    with NetworkPit(replace(setting, entries=entries)) as pit:
        setting.on_open(invitations(setting, pit.address))
        pit.add({}, list(left.values()))
        pit.finish()
        seen_at_s = time.monotonic()
        while pit.n_left:
            yield from pit.receive()
            if not pit.awaited:
                seen_at_s = time.monotonic()
            elif time.monotonic() - seen_at_s > setting.absence_s:
                name = min(pit.awaited)
                raise EntryLostError(name, f"{name} has not come for {setting.absence_s:g} s")
    yield from pit.receive()


class NetworkPit:
    """A pit that goes on: entries and matches are added while it plays, until it is left.

    It is used by `with`, from one thread that lasts, as the kernel ends the clients with the thread that started them. The
    entries of the setting are known as it opens, before anybody can join. `receive` is to be called again and again: whoever
    died is started anew by it, clients start when they have matches to play, and end when they have had none for some seconds;
    at most `setting.most_clients` live at once, and matches of others wait their turn, in the order in which they were added.

    An entry that joins by itself (`arena join --forever`) stays connected while it has no matches, and its matches wait until it
    is there.

    Attributes
    ----------
    address
        Where the pit is.

    Raises
    ------
    ArenaError
        On entry and in `receive`: the referee, or the process that clients are forked from, died again and again; a log says why.
    """

    def __init__(self, setting: VenueSetting) -> None:
        self._setting = setting
        self.address = address_of(setting)
        self._names: dict[str, bytes] = {}
        self._fighters: dict[str, Fighter] = {}
        self._left: dict[str, MatchPlan] = {}
        self._running: dict[str, MatchPlan] = {}
        self._n_left: Counter[str] = Counter()
        self._n_ended: Counter[str] = Counter()
        """Matches by entry."""
        self._withdrawn: Counter[str] = Counter()
        """The entries that are withdrawn, as soon as the referee has done so."""
        self._waiting: frozenset[str] = frozenset()
        self._settling: deque[tuple[float, Outcome]] = deque()
        """Matches that are over, and by when what their fighters met as they were ended is known."""
        self._is_finished, self._is_closed = False, False
        self._processes = ExitStack()
        bare = replace(setting, on_open=ignore_invitations, entries={}, sandboxes={}, remote={})
        self._referee = RefereeProcess(bare, self.address)
        self._fork_server = ForkServer(setting) if can_fork() else None
        self._clients = ClientPool(setting, self.address.from_here(), self._referee.tell, self._fork_server)

    def __enter__(self) -> "NetworkPit":
        data_folder(self._setting.journals)
        self._take_in(self._setting.fighters)
        with ExitStack() as processes:
            if self._fork_server is not None:
                processes.enter_context(self._fork_server)
                if any(map(may_fork, self._fighters.values())):
                    self._fork_server.begin()  # it gets ready while the referee does
            processes.enter_context(self._referee)
            self._start_referee()
            processes.enter_context(self._clients)
            self._processes = processes.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all processes. What ended before, and was not received yet, `receive` still returns."""
        self._processes.close()
        self._is_closed = True

    @property
    def n_left(self) -> int:
        """Matches that were added and have not ended."""
        return len(self._left)

    @property
    def present(self) -> frozenset[str]:
        """The entries that join by themselves and are there, as far as `receive` has heard."""
        playing = {name for plan in self._running.values() for name in (plan.blue, plan.red)}
        return self._waiting | {name for name in playing if self._fighters[name].public_key is not None}

    @property
    def awaited(self) -> frozenset[str]:
        """The entries that join by themselves and are not there, if every match that is left waits for one of them."""
        away = {name for name, fighter in self._fighters.items() if fighter.public_key is not None} - self.present
        waited = [away & {plan.blue, plan.red} for plan in self._left.values()]
        return frozenset().union(*waited) if all(waited) else frozenset()

    @property
    def failing(self) -> frozenset[str]:
        """The entries whose client dies again and again, or was given up: their matches begin late or never."""
        return self._clients.failing

    def add(self, entries: Mapping[str, Fighter], plans: Sequence[MatchPlan]) -> None:
        """Let entries in, by label, and put matches at the end of the plan; at any time, until `finish`.

        A match whose journal is whole, since it ended before its result was told, is received as it ended; one whose journal was
        begun goes on at its tick.

        Parameters
        ----------
        entries
            What fights for each label that `plans` name first; those that are known may be named again, as they are.

        Raises
        ------
        InputError
            The file of a fighter cannot be read.
        ValueError
            A match is on the plan already, or of an entry that is not known, or an entry is another than it was.
        """
        new = self._check(entries, plans)
        self._take_in(new)
        for plan in plans:
            self._left[plan.identity] = plan
            self._n_left.update((plan.blue, plan.red))
        for outcome in find_ended(self._setting.journals, self._setting.ruleset, plans):
            self._end(outcome, settle_s=0.0)
        left = [plan for plan in plans if plan.identity in self._left]
        self._referee.tell(self._addition(new, left[:MOST_PLANS]))
        for first in range(MOST_PLANS, len(left), MOST_PLANS):
            self._referee.tell(self._addition((), left[first : first + MOST_PLANS]))

    def withdraw(self, names: Collection[str], reason: str) -> None:
        """Take off the plan what these entries have not begun to play; it is received as void, for this reason.

        Their clients stay until they have been idle for some time, and those that join by themselves for as long as they like.
        """
        self._withdrawn.update(names)
        self._referee.tell(Withdrawal(frozenset(names), reason))

    def finish(self) -> None:
        """Add nothing more: an entry whose matches have all begun is told that the pit has no more.

        From now on, `receive` raises `ArenaError` for a client that dies again and again and plays no match. Before, its matches
        are void, and nobody else is disturbed.
        """
        self._is_finished = True
        self._referee.tell(Finish())

    def receive(self) -> list[Outcome]:
        """Return the matches that ended meanwhile; wait for some, but only for a moment.

        Void matches are told of, and not played again unless they are added again. It takes longer, some seconds, where the
        referee died and is started anew.
        """
        if not self._is_closed:
            is_gone = False
            try:
                heard = self._referee.receive(0.0 if self._settling and self._settling[0][0] <= time.monotonic() else _POLL_S)
            except EOFError:
                is_gone, heard = True, []
                self._referee.reap()
                # What it wrote to a journal and could not tell any more has ended; only the rest is played.
                heard += find_ended(self._setting.journals, self._setting.ruleset, list(self._left.values()))
            for message in heard:
                self._hear(message)
            if is_gone and (self._left or not self._is_finished):
                self._start_referee()
            self._tend_clients()
        ended = []
        while self._settling and (self._is_closed or self._settling[0][0] <= time.monotonic()):
            ended.append(self._with_limits_met(self._settling.popleft()[1]))
        return ended

    def _check(self, entries: Mapping[str, Fighter], plans: Sequence[MatchPlan]) -> dict[str, Fighter]:
        """Return the entries that are new."""
        check_plans(plans, self._left, {*entries, *self._fighters}, "pit")
        for name, fighter in entries.items():
            if self._fighters.get(name, fighter) != fighter:
                raise ValueError(f"the entry {name} is another than it was; call it otherwise")
        return {name: fighter for name, fighter in entries.items() if name not in self._fighters}

    def _take_in(self, new: Mapping[str, Fighter]) -> None:
        for name, fighter in freeze(new).items():
            if fighter.public_key is None:
                self._clients.add(name, fighter)
            self._names[name] = fighter.public_key or load_or_make(entry_key_path(self._setting, name)).public
        self._fighters |= new

    def _addition(self, names: Collection[str], plans: Sequence[MatchPlan]) -> Addition:
        remote = frozenset(name for name in names if self._fighters[name].public_key is not None)
        return Addition(names={name: self._names[name] for name in names}, remote=remote, plans=plans)

    def _start_referee(self) -> None:
        known = self._addition(self._names, list(self._left.values()))
        self._waiting = frozenset()
        # A match that left no journal is begun anew, and waits for both of its entries again.
        journals = self._setting.journals
        self._running = {name: plan for name, plan in self._running.items() if (journals / journal_name(name)).exists()}
        self._referee.start(known, self._clients.leaving, is_finished=self._is_finished)
        self._clients.on_new_referee()

    def _hear(self, message: Outcome | News | Done) -> None:
        match message:
            case Outcome():
                self._end(message, settle_s=_SETTLE_S)
            case News():
                self._waiting = message.waiting
                self._running |= {identity: self._left[identity] for identity in message.begun if identity in self._left}
            case Done(told=Call(name=name)):
                self._clients.on_call(name)
            case Done(told=Withdrawal(names=names, reason=reason)):
                self._withdrawn -= Counter(names)
                for identity in message.withdrawn:
                    if identity in self._left:
                        self._end(Outcome.void(self._left[identity], reason), settle_s=0.0)

    def _end(self, outcome: Outcome, settle_s: float) -> None:
        if self._left.pop(outcome.identity, None) is None:
            return
        self._running.pop(outcome.identity, None)
        names = (outcome.blue, outcome.red)
        self._n_ended.update(names)
        self._n_left.subtract(names)
        is_limited = any(self._fighters[name].sandbox is not None for name in names)
        self._settling.append((time.monotonic() + is_limited * settle_s, outcome))

    def _tend_clients(self) -> None:
        left: Iterable[MatchPlan] = self._left.values()
        if self._withdrawn:
            left = [plan for plan in left if not {plan.blue, plan.red} & self._withdrawn.keys()]
        for name, why in self._clients.tend(self._running.values(), left, self._n_left, self._n_ended, self._waiting):
            if self._is_finished:
                raise EntryLostError(name, why)
            self.withdraw([name], why)

    def _with_limits_met(self, outcome: Outcome) -> Outcome:
        """Return an outcome with the limits among its faults that its fighters met since the outcome before."""
        seats = {
            team: replace(outcome.seats[team], faults={**outcome.seats[team].faults, **self._clients.take_limits_met(name)})
            for team, name in ((Team.BLUE, outcome.blue), (Team.RED, outcome.red))
        }
        return replace(outcome, seats=seats)
