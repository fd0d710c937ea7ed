"""The register: whose a name is, which key used an invite, who is banned; and a file that is whole or untouched."""

import json
import os
import resource
import stat
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import ArenaError, InputError
from arena.pit.register import Register, read_invites
from arena.protocol.identity import to_text
from arena.protocol.messages import JoinRequest

ANN = bytes(range(32))
BOB = bytes(range(32, 64))


def request(entry: bytes = ANN, name: str = "ann", invite: str = "") -> JoinRequest:
    return JoinRequest(rules_version=1, name=name, team="any", client="c", slot=0, invite=invite, entry=entry)


# Names


def test_a_name_that_is_nobody_s_may_be_played_under_by_anyone() -> None:
    register = Register()

    assert register.object_to(request(ANN)) == ""
    assert register.object_to(request(BOB)) == ""


def test_a_name_belongs_to_its_first_claimer_and_another_key_is_told_what_to_do() -> None:
    register = Register()
    register.claim("ann", ANN)
    register.claim("ann", BOB)

    assert register.object_to(request(ANN)) == ""
    assert register.object_to(request(BOB)) == (
        "the name ann belongs to another key; choose one with --name, or ask the operator for `arena admin release-name ann`"
    )
    assert register.object_to(request(BOB, name="bob")) == ""


def test_asking_under_a_name_does_not_claim_it() -> None:
    register = Register()
    register.object_to(request(BOB))
    register.admit(request(BOB))

    assert register.object_to(request(ANN)) == ""


def test_a_released_name_is_free() -> None:
    register = Register()
    register.claim("ann", ANN)

    assert register.release("ann")
    assert not register.release("ann")
    register.claim("ann", BOB)
    assert register.object_to(request(BOB)) == ""
    assert register.object_to(request(ANN)) != ""


def test_names_can_be_given_beforehand() -> None:
    register = Register(names={"ann": ANN})

    assert register.object_to(request(ANN)) == ""
    assert "belongs to another key" in register.object_to(request(BOB))


def test_a_key_is_found_by_its_name_or_its_text() -> None:
    register = Register(names={"ann": ANN})

    assert register.find("ann") == ANN
    assert register.find(to_text(BOB)) == BOB
    assert register.find("bob") is None
    assert register.find("") is None


def test_nobody_plays_under_a_name_that_is_another_s_key() -> None:
    """Else who is banned by key might hide behind the name, and somebody else be banned."""
    register = Register()

    assert "look like a public key" in register.object_to(request(BOB, name=to_text(ANN)))
    assert "look like a public key" in register.object_to(request(ANN, name=to_text(ANN)))
    assert register.object_to(request(ANN, name=to_text(ANN)[:-1])) == ""


# Bans


@pytest.mark.parametrize("target", ["ann", to_text(ANN)])
def test_who_is_banned_by_name_or_key_may_not_play_under_any_name(target: str) -> None:
    register = Register(names={"ann": ANN})
    key = register.find(target)
    assert key == ANN

    register.ban(target, key)

    assert register.object_to(request(ANN)) == "this key is banned from the pit"
    assert register.object_to(request(ANN, name="other")) == "this key is banned from the pit"
    assert register.object_to(request(BOB, name="bob")) == ""


def test_a_banned_key_is_banned_before_its_invite_is_looked_at() -> None:
    register = Register(invites=["code"])
    register.admit(request(ANN, invite="code"))
    register.ban("ann", ANN)

    assert register.object_to(request(ANN, invite="code")) == "this key is banned from the pit"


# Invites


def test_a_pit_without_invites_wants_none() -> None:
    register = Register()

    assert not register.needs_invite
    assert register.object_to(request(invite="anything")) == ""


@pytest.mark.parametrize(
    ("invite", "answer"),
    [
        ("", "this pit wants an invite code; join with --invite CODE"),
        ("wrong", "the invite code is none of this pit's"),
        ("CODE", "the invite code is none of this pit's"),
        ("code", ""),
    ],
)
def test_an_invite_is_wanted_and_must_be_the_pit_s(invite: str, answer: str) -> None:
    register = Register(invites=["code", "other"])

    assert register.needs_invite
    assert register.object_to(request(invite=invite)) == answer


def test_a_pit_that_wants_invites_and_has_none_lets_nobody_in() -> None:
    register = Register(invites=[])

    assert register.needs_invite
    assert register.object_to(request()) != ""
    assert register.object_to(request(invite="code")) != ""


def test_an_invite_is_the_key_s_that_came_with_it_first() -> None:
    register = Register(invites=["code", "other"])
    register.admit(request(ANN, invite="code"))

    assert register.object_to(request(ANN, invite="code")) == ""
    assert register.object_to(request(ANN, name="again", invite="code")) == ""
    assert register.object_to(request(BOB, name="bob", invite="code")) == "the invite code was used by another key"
    assert register.object_to(request(BOB, name="bob", invite="other")) == ""


def test_an_invite_is_not_taken_over_by_a_later_key() -> None:
    register = Register(invites=["code"])
    register.admit(request(ANN, invite="code"))
    register.admit(request(BOB, invite="code"))

    assert register.object_to(request(ANN, invite="code")) == ""
    assert register.object_to(request(BOB, name="bob", invite="code")) != ""


def test_keys_that_came_by_codes_of_one_owner_are_its() -> None:
    register = Register(invites={"one": "ann", "two": "ann", "three": "three"})
    for key, invite in ((ANN, "one"), (BOB, "two"), (bytes(32), "three")):
        register.admit(request(key, invite=invite))

    assert register.owner_of(ANN) == register.owner_of(BOB)
    assert len({register.owner_of(key) for key in (ANN, bytes(32), bytes(range(1, 33)))}) == 3


def test_without_invites_every_key_is_its_own_owner() -> None:
    register = Register()

    assert register.owner_of(ANN) == to_text(ANN)


# The file


def test_a_register_that_changed_says_so_until_it_is_saved() -> None:
    register = Register(invites=["code"], names={"ann": ANN})
    changes = (
        lambda: register.claim("bob", BOB),
        lambda: register.admit(request(ANN, invite="code")),
        lambda: register.release("bob"),
        lambda: register.ban("bob", BOB),
    )
    for change in changes:
        assert not register.is_changed
        change()
        assert register.is_changed
        register.save()

    register.claim("ann", BOB)
    register.admit(request(ANN, invite="code"))
    register.release("nobody")
    assert not register.is_changed


def filled(path: Path) -> Register:
    register = Register(path, invites=["code", "other"])
    register.claim("ann", ANN)
    register.admit(request(ANN, invite="code"))
    register.ban("bob", BOB)
    register.save()
    return register


def test_names_invites_and_bans_outlive_the_process(tmp_path: Path) -> None:
    filled(tmp_path / "register.json")

    again = Register(tmp_path / "register.json", invites=["code", "other"])

    assert again.find("ann") == ANN
    assert again.object_to(request(ANN, invite="code")) == ""
    assert "belongs to another" in again.object_to(request(bytes(32), invite="other"))
    assert again.object_to(request(bytes(32), name="c", invite="code")) == "the invite code was used by another key"
    assert again.object_to(request(BOB, name="b", invite="other")) == "this key is banned from the pit"


def test_a_released_name_stays_released(tmp_path: Path) -> None:
    register = filled(tmp_path / "register.json")
    register.release("ann")
    register.save()

    assert Register(tmp_path / "register.json").find("ann") is None


def test_the_file_is_the_operator_s_alone_and_readable(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        filled(tmp_path / "register.json")
    finally:
        os.umask(before)

    assert stat.S_IMODE((tmp_path / "register.json").stat().st_mode) == 0o600
    assert json.loads((tmp_path / "register.json").read_text()) == {
        "names": {"ann": to_text(ANN)},
        "invites": {"code": to_text(ANN)},
        "banned": {to_text(BOB): "bob"},
    }
    assert [path.name for path in tmp_path.iterdir()] == ["register.json"]


def test_a_register_that_nothing_was_written_to_leaves_no_file(tmp_path: Path) -> None:
    Register(tmp_path / "register.json").object_to(request())

    assert list(tmp_path.iterdir()) == []


def test_a_register_in_memory_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    register = Register()
    register.claim("ann", ANN)
    register.save()

    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("failing", ["os.replace", "json.dump", "tempfile.mkstemp"])
def test_what_cannot_be_written_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    register = filled(tmp_path / "register.json")
    register.claim("more", BOB)
    register.save()
    before = (tmp_path / "register.json").read_bytes()

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(failing, fail)
    with pytest.raises(ArenaError, match=r"cannot write .*register\.json: No space left on device"):
        Register(tmp_path / "register.json")

    assert (tmp_path / "register.json").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["register.json"]


def test_a_name_more_does_not_write_the_others_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    register = filled(tmp_path / "register.json")
    whole = (tmp_path / "register.json").read_bytes()
    monkeypatch.setattr("json.dump", None)

    register.claim("more", BOB)
    register.release("ann")
    register.save()

    monkeypatch.undo()
    assert (tmp_path / "register.json").read_bytes().startswith(whole)
    again = Register(tmp_path / "register.json")
    assert (again.find("more"), again.find("ann")) == (BOB, None)
    assert json.loads((tmp_path / "register.json").read_text())["names"] == {"more": to_text(BOB)}, "as it is when a pit opens"


def test_a_crash_while_a_name_is_written_loses_no_other(tmp_path: Path) -> None:
    path = tmp_path / "register.json"
    register = filled(path)
    n_whole = len(path.read_bytes())
    register.claim("more", BOB)
    register.save()
    data = path.read_bytes()

    for n_bytes in range(n_whole, len(data) + 1):
        path.write_bytes(data[:n_bytes])
        again = Register(path)
        assert (again.find("ann"), again.find("more")) == (ANN, BOB if n_bytes == len(data) else None)
        again.claim("later", BOB)
        again.save()
        assert Register(path).find("later") == BOB


def test_a_change_that_cannot_be_written_is_one_arena_error(tmp_path: Path) -> None:
    register = filled(tmp_path / "register.json")
    (tmp_path / "register.json").unlink()
    (tmp_path / "register.json").mkdir()
    register.claim("more", BOB)

    with pytest.raises(ArenaError, match=r"cannot write .*register\.json: Is a directory"):
        register.save()


def test_a_disk_that_takes_half_a_change_spoils_nothing_for_who_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "register.json"
    register = filled(path)
    n_whole = len(path.read_bytes())
    register.claim("more", BOB)

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_whole + 5, before[1]))
    try:
        with pytest.raises(ArenaError, match=r"cannot write .*register\.json: the disk is full"):
            register.save()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert register.is_changed
    assert len(path.read_bytes()) == n_whole
    register.claim("later", BOB)
    register.save()

    again = Register(path)
    assert (again.find("ann"), again.find("more"), again.find("later")) == (ANN, BOB, BOB)


def test_a_folder_that_is_gone_is_one_arena_error(tmp_path: Path) -> None:
    with pytest.raises(ArenaError, match="cannot write"):
        Register(tmp_path / "gone" / "register.json").save()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        "{}",
        '{"names": {}}',
        '{"names": [], "invites": {}, "banned": {}}',
        '{"names": {"ann": "no key"}, "invites": {}, "banned": {}}',
        '{"names": {"ann": null}, "invites": {}, "banned": {}}',
        '{"names": {}, "invites": {"code": "no key"}, "banned": {}}',
        '{"names": {}, "invites": {}, "banned": {"no key": "ann"}}',
        '{"names": {}, "invites": {}, "banned": {}} {}',
        '{"names": {}, "invites": {}, "banned": {}}\njunk\n["names", "ann", null]',
        '{"names": {}, "invites": {}, "banned": {}}\n["titles", "ann", null]',
        '{"names": {}, "invites": {}, "banned": {}}\n["names"]',
        '{"names": {}, "invites": {}, "banned": {}}\n["names", "ann", "no key"]',
        "[" * 100_000,
    ],
    ids=range(17),
)
def test_a_broken_file_is_one_input_error_and_is_not_touched(tmp_path: Path, text: str) -> None:
    path = tmp_path / "register.json"
    path.write_text(text)

    with pytest.raises(InputError, match=r"register\.json is no register of names; move it away"):
        Register(path)

    assert path.read_text() == text


@given(st.binary(max_size=60), st.integers(0))
def test_a_file_that_was_cut_or_changed_is_read_or_one_input_error(
    tmp_path_factory: pytest.TempPathFactory, more: bytes, at: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "changed.json"
    path.unlink(missing_ok=True)
    filled(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: at % len(whole)] + more)

    try:
        register = Register(path)
    except InputError:
        return
    register.find("ann")
    register.object_to(request())


def test_a_register_that_is_a_folder_is_one_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read"):
        Register(tmp_path)


# Invites in a file


def test_invites_are_read_one_a_line_without_comments(tmp_path: Path) -> None:
    (tmp_path / "invites").write_text("# for the tournament\n\n  one  \ntwo # for bob\n#three\nfour#4\nfive  bob\n")

    assert read_invites(tmp_path / "invites") == {"one": "one", "two": "two", "four": "four", "five": "bob"}


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "holds no invite codes; write one a line"),
        (b"# none\n\n", "holds no invite codes; write one a line"),
        (b"one\ntwo\none # again\n", "holds an invite code twice"),
        (b"one ann smith\n", "write an invite code, and behind it its owner"),
        (b"\xff\xfe\xff", "it is no text"),
    ],
)
def test_invites_that_cannot_be_used_are_one_input_error(tmp_path: Path, data: bytes, sentence: str) -> None:
    (tmp_path / "invites").write_bytes(data)

    with pytest.raises(InputError, match=sentence):
        read_invites(tmp_path / "invites")


def test_invites_that_are_not_there_are_one_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read invites from .*: No such file"):
        read_invites(tmp_path / "gone")
