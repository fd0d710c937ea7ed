"""The token of an owner's page: it says whose it is, for one season and for some time."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import ForgedError
from arena.protocol.identity import Identity
from arena.protocol.page_token import TOKEN_S, make_page_link, make_page_token, read_page_token

ANN = Identity.make()
HOST = "arena.example:8000"
NOW_S = 1_800_000_000.5


def test_a_token_tells_its_owners_key_until_its_time_is_over() -> None:
    token = make_page_token(ANN, HOST, "course", NOW_S)

    assert read_page_token(token, HOST, "course", NOW_S) == ANN.fingerprint
    assert read_page_token(token, HOST, "course", NOW_S + TOKEN_S - 1) == ANN.fingerprint
    with pytest.raises(ForgedError, match="time of this token is over"):
        read_page_token(token, HOST, "course", NOW_S + TOKEN_S)


def test_a_token_opens_no_other_season() -> None:
    with pytest.raises(ForgedError):
        read_page_token(make_page_token(ANN, HOST, "course", NOW_S), HOST, "cours", NOW_S)


def test_a_token_opens_no_page_of_another_host() -> None:
    with pytest.raises(ForgedError):
        read_page_token(make_page_token(ANN, "evil.example", "course", NOW_S), HOST, "course", NOW_S)


@pytest.mark.parametrize(
    ("page", "host"),
    [
        ("http://127.0.0.1:8000", "127.0.0.1:8000"),
        ("https://Arena.example/", "arena.example"),
        ("https://arena.example:443", "arena.example"),
        ("http://arena.example:80", "arena.example"),
        ("http://arena.example:443", "arena.example:443"),
        ("http://[::1]:8000", "[::1]:8000"),
    ],
)
def test_a_token_stands_in_the_fragment_of_its_link_and_is_of_its_host(page: str, host: str) -> None:
    link, _, token = make_page_link(ANN, page, "course", "ann", NOW_S).partition("#token=")

    assert link == f"{page.removesuffix('/')}/seasons/course/ann"
    assert read_page_token(token, host, "course", NOW_S) == ANN.fingerprint


@given(at=st.integers(0, 138), letter=st.sampled_from("ABab01-_"))
def test_a_token_in_which_a_letter_was_changed_is_none(at: int, letter: str) -> None:
    token = make_page_token(ANN, HOST, "course", NOW_S)
    changed = token[:at] + letter + token[at + 1 :]
    if changed != token:
        with pytest.raises(ForgedError):
            read_page_token(changed, HOST, "course", NOW_S)


@given(st.text())
def test_whatever_is_no_token_is_refused(text: str) -> None:
    with pytest.raises(ForgedError):
        read_page_token(text, HOST, "course", NOW_S)


def test_a_signature_under_another_label_is_no_token() -> None:
    with pytest.raises(ForgedError):
        read_page_token(make_page_token(_Relabelled(ANN.private), HOST, "course", NOW_S), HOST, "course", NOW_S)


class _Relabelled(Identity):
    """An owner who signs the same bytes as something else."""

    def sign(self, label: str, data: bytes) -> bytes:
        return super().sign("fact", data)
