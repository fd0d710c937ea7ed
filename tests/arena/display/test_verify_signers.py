"""`arena replay verify`: whose signatures a journal must bear."""

import json
import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from sealed_match import ENTRIES, PIT, PUBLIC, STRANGER, Played

from arena.game.types import Team, Termination
from arena.keyring.files import load_or_make
from arena.keyring.known_pits import check_pit
from arena.keyring.ring import entry_key_path
from arena.policy import MatchResult
from arena.protocol.identity import Identity, to_text
from arena.records.journal import write_ending

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def played() -> Played:
    return Played().play()


@pytest.fixture
def file(played: Played, tmp_path: Path) -> Path:
    path = tmp_path / "match.journal"
    path.write_bytes(played.data())
    return path


def reason(done: subprocess.CompletedProcess[str]) -> str:
    facts = json.loads(done.stdout)
    assert (done.returncode, facts["ok"]) == (1, False)
    return str(facts["error"])


def test_keys_that_nobody_here_knows_are_shown_as_unknown(here: Run, file: Path) -> None:
    """Whoever makes a journal with keys of one's own, in the names of a real pit and players, has these rows to fear."""
    done, document = here("replay", "verify", file), here("replay", "verify", file, "--json")

    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "1 of 1 journals hold")
    for who, identity in (("the pit", PIT), ("entry ann", ENTRIES[Team.BLUE]), ("entry bob", ENTRIES[Team.RED])):
        assert re.search(rf"^ ?{who} +1 +unknown key {identity.fingerprint} *$", done.stdout, re.MULTILINE)
    assert json.loads(document.stdout)["keys"]["blue"] == {
        "name": "ann",
        "key": to_text(PUBLIC[Team.BLUE]),
        "known_as": None,
    }


@pytest.mark.parametrize("form", ["{}", "arena://127.0.0.1:7447/pit#{}"])
def test_the_pit_must_be_the_one_that_was_named(here: Run, file: Path, form: str) -> None:
    right, wrong = (form.format(one.fingerprint) for one in (PIT, STRANGER))

    assert here("replay", "verify", file, "--pit", right).returncode == 0
    assert reason(here("replay", "verify", file, "--pit", wrong, "--json")) == (
        f"it is signed by the pit {PIT.fingerprint}; --pit is {STRANGER.fingerprint}"
    )


def test_the_entries_must_be_those_that_were_named(here: Run, file: Path) -> None:
    ann, bob = (f"{name}={ENTRIES[team].fingerprint}" for name, team in (("ann", Team.BLUE), ("bob", Team.RED)))

    assert here("replay", "verify", file, "--entry", ann, "--entry", bob).returncode == 0
    said = reason(here("replay", "verify", file, "--entry", ann, "--entry", f"bob={STRANGER.fingerprint}", "--json"))
    assert said == f"its bob has the key {ENTRIES[Team.RED].fingerprint}; --entry is {STRANGER.fingerprint}"


def test_the_loser_cannot_write_another_ending_behind_the_pit_s_commitment(here: Run, played: Played, tmp_path: Path) -> None:
    path, tick = tmp_path / "forfeit.journal", played.journal().ticks[4]
    data = played.data(receipts={}, signature=b"")
    data = data[: data.index(tick.chain) + len(tick.chain)]
    path.write_bytes(data + write_ending(tick.chain, MatchResult(ending=Termination.FORFEIT, winner=Team.RED, score=0, ticks=5)))

    said = reason(here("replay", "verify", path, "--pit", PIT.fingerprint, "--json"))

    assert said == "no pit signed it; if it was played without one, on a machine that you trust, add --local"


def test_a_journal_without_its_signatures_holds_as_a_local_one_alone(here: Run, played: Played, tmp_path: Path) -> None:
    path = tmp_path / "stripped.journal"
    path.write_bytes(played.plain)

    assert "no pit signed it" in reason(here("replay", "verify", path, "--json"))
    assert here("replay", "verify", path, "--local").returncode == 0


def test_the_pits_and_entries_that_one_knows_are_shown_by_name(here: Run, file: Path) -> None:
    check_pit("127.0.0.1:7447/pit", PIT.public, None)
    own_key(ENTRIES[Team.BLUE], entry_key_path("ann"))

    said = here("replay", "verify", file).stdout

    assert f"127.0.0.1:7447/pit {PIT.fingerprint}" in said
    assert f"your key ann {ENTRIES[Team.BLUE].fingerprint}" in said
    assert f"unknown key {ENTRIES[Team.RED].fingerprint}" in said


def test_nobody_else_plays_under_a_name_of_one_s_own(here: Run, file: Path) -> None:
    own = load_or_make(entry_key_path("bob")).fingerprint
    other = ENTRIES[Team.RED].fingerprint

    said = reason(here("replay", "verify", file, "--json"))

    assert said == (
        f"its bob has the key {other}, not your own key of that name; if another has that name there, "
        f"say --entry bob={other}; for a league of yours, --data DIR"
    )
    assert here("replay", "verify", file, "--entry", f"bob={other}").returncode == 0
    assert own != other


@pytest.mark.parametrize("league", ["", "cup"])
def test_journals_of_one_s_own_data_folder_are_by_the_keys_beside_them(
    here: Run, played: Played, tmp_path: Path, league: str
) -> None:
    own_key(PIT, tmp_path / "keys" / league / "pit.key")
    own_key(ENTRIES[Team.BLUE], tmp_path / "keys" / league / "entries" / "ann.key")
    path, forged = (tmp_path / "journals" / league / f"{name}.journal" for name in ("genuine", "forged"))
    path.parent.mkdir(parents=True)
    path.write_bytes(played.data())
    load_or_make(entry_key_path("ann"))  # another key of the same name, which plays elsewhere
    done = here("replay", "verify", path, "--data", tmp_path)
    assert done.returncode == 0
    assert f"the pit of this data folder {PIT.fingerprint}" in done.stdout
    assert f"the key ann of this league {ENTRIES[Team.BLUE].fingerprint}" in done.stdout

    (tmp_path / "keys" / league / "pit.key").unlink()
    own_key(STRANGER, tmp_path / "keys" / league / "pit.key")
    path.rename(forged)

    said = reason(here("replay", "verify", forged, "--data", tmp_path, "--json"))
    assert said == f"it is signed by the pit {PIT.fingerprint}; the key beside these journals is {STRANGER.fingerprint}"


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--pit", "nonsense"], "'nonsense' is no public key; it has 43 letters, digits, - and _"),
        (["--pit", "arena://127.0.0.1:7447/pit"], "an address without a key"),
        (["--entry", "ann"], "--entry is 'ann'; write NAME=KEY"),
        (["--entry", f"eve={STRANGER.fingerprint}"], "--entry names 'eve', who plays in none of these journals"),
        (["--entry", f"ann={STRANGER.fingerprint}", "--entry", f"ann={PIT.fingerprint}"], "--entry gives ann two keys"),
        (["--local", "--pit", PIT.fingerprint], "--local takes journals that nobody signed"),
    ],
)
def test_what_cannot_be_compared_is_one_sentence(here: Run, file: Path, options: list[str], sentence: str) -> None:
    done = here("replay", "verify", file, *options)

    assert (done.returncode, done.stdout) == (2, "")
    assert sentence in done.stderr


def test_a_bad_file_among_others_is_a_line_and_the_others_are_verified(here: Run, file: Path, tmp_path: Path) -> None:
    folder = tmp_path
    os.mkfifo(folder / "pipe.journal")
    (folder / "zero.journal").symlink_to("/dev/zero")
    (folder / "dangling.journal").symlink_to(folder / "nowhere")
    (folder / "folder.journal").mkdir()
    with (folder / "sparse.journal").open("wb") as sparse:
        sparse.truncate(30 << 30)

    done = here("replay", "verify", folder, "--json")

    assert done.returncode == 1
    found = {Path(facts["file"]).stem: facts.get("error") for facts in json.loads(done.stdout)}
    assert found == {
        "match": None,
        "pipe": f"cannot read {folder}/pipe.journal: it is a pipe, not a file",
        "zero": f"cannot read {folder}/zero.journal: it is a device, not a file",
        "dangling": f"cannot read {folder}/dangling.journal: No such file or directory",
        "folder": f"{folder}/folder.journal is a folder; name one of the files in it",
        "sparse": f"cannot read {folder}/sparse.journal: it is larger than 67,108,864 bytes",
    }


def own_key(identity: Identity, path: Path) -> None:
    """Keep a key as its owner does."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch(mode=0o600)
    path.write_bytes(identity.private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
