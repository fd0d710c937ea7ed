"""The token of an owner's page: it says whose it is, for one season and for some time."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import ForgedError
from arena.protocol.identity import Identity
from arena.protocol.page_token import TOKEN_S, make_page_token, page_link, read_page_token

ANN = Identity.make()
NOW_S = 1_800_000_000.5


def test_a_token_tells_its_owners_key_until_its_time_is_over() -> None:
    token = make_page_token(ANN, "course", NOW_S)

    assert read_page_token(token, "course", NOW_S) == ANN.fingerprint
    assert read_page_token(token, "course", NOW_S + TOKEN_S - 1) == ANN.fingerprint
    with pytest.raises(ForgedError, match="time of this token is over"):
        read_page_token(token, "course", NOW_S + TOKEN_S)


def test_a_token_opens_no_other_season() -> None:
    with pytest.raises(ForgedError):
        read_page_token(make_page_token(ANN, "course", NOW_S), "cours", NOW_S)


def test_a_token_stands_in_the_fragment_of_its_link() -> None:
    assert page_link("http://x:8000/", "course", "ann", "abc") == "http://x:8000/seasons/course/ann#token=abc"


@given(at=st.integers(0, 138), letter=st.sampled_from("ABab01-_"))
def test_a_token_in_which_a_letter_was_changed_is_none(at: int, letter: str) -> None:
    token = make_page_token(ANN, "course", NOW_S)
    changed = token[:at] + letter + token[at + 1 :]
    if changed != token:
        with pytest.raises(ForgedError):
            read_page_token(changed, "course", NOW_S)


@given(st.text())
def test_whatever_is_no_token_is_refused(text: str) -> None:
    with pytest.raises(ForgedError):
        read_page_token(text, "course", NOW_S)


def test_a_signature_under_another_label_is_no_token() -> None:
    with pytest.raises(ForgedError):
        read_page_token(make_page_token(_Relabelled(ANN.private), "course", NOW_S), "course", NOW_S)


class _Relabelled(Identity):
    """An owner who signs the same bytes as something else."""

    def sign(self, label: str, data: bytes) -> bytes:
        return super().sign("fact", data)
