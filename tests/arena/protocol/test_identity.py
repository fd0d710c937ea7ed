"""Identities: what is signed is exactly what is documented, and no signature passes for another."""

from collections.abc import Callable

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import ForgedError, InputError
from arena.protocol.identity import PUBLIC_BYTES, SIGNATURE_BYTES, Identity, from_text, to_text, verify

ANN = Identity(Ed25519PrivateKey.from_private_bytes(bytes(range(32))))
BOB = Identity(Ed25519PrivateKey.from_private_bytes(bytes(range(32, 64))))
LABELS = ("challenge", "request", "fact", "receipt", "journal")


def test_a_signature_is_plain_ed25519_over_arena_label_zero_data() -> None:
    """Test 1 of RFC 8032 gives the key pair; the message is the arena's own."""
    private = bytes.fromhex("9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60")
    identity = Identity(Ed25519PrivateKey.from_private_bytes(private))
    plain = Ed25519PrivateKey.from_private_bytes(private)

    assert identity.public.hex() == "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a"
    assert plain.sign(b"").hex().startswith("e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555f")
    assert identity.sign("fact", b"data") == plain.sign(b"arena fact\x00data")
    Ed25519PublicKey.from_public_bytes(identity.public).verify(identity.sign("fact", b"data"), b"arena fact\x00data")
    verify(identity.public, "fact", b"data", plain.sign(b"arena fact\x00data"))


@given(st.sampled_from(LABELS), st.binary(max_size=99))
def test_what_was_signed_verifies(label: str, data: bytes) -> None:
    signature = ANN.sign(label, data)

    assert len(signature) == SIGNATURE_BYTES
    verify(ANN.public, label, data, signature)


@pytest.mark.parametrize("signed", LABELS)
def test_a_signature_under_one_label_holds_under_no_other(signed: str) -> None:
    signature = ANN.sign(signed, b"data")

    for label in {*LABELS, "", signed + "s", signed[:-1], signed.upper()} - {signed}:
        with pytest.raises(ForgedError, match=f"the signature of a {label} does not hold"):
            verify(ANN.public, label, b"data", signature)


def test_the_end_of_a_label_cannot_be_passed_off_as_the_beginning_of_the_data() -> None:
    with pytest.raises(ForgedError):
        verify(ANN.public, "fact", b"s", ANN.sign("facts", b""))


def test_another_s_signature_does_not_hold() -> None:
    with pytest.raises(ForgedError):
        verify(ANN.public, "fact", b"data", BOB.sign("fact", b"data"))


@given(st.binary(max_size=40), st.binary(max_size=40))
def test_a_signature_holds_for_its_own_data_only(signed: bytes, shown: bytes) -> None:
    if signed != shown:
        with pytest.raises(ForgedError):
            verify(ANN.public, "fact", shown, ANN.sign("fact", signed))


def test_no_bit_of_a_signature_can_be_changed() -> None:
    signature = ANN.sign("fact", b"data")

    for bit in range(8 * SIGNATURE_BYTES):
        changed = (int.from_bytes(signature, "big") ^ 1 << bit).to_bytes(SIGNATURE_BYTES, "big")
        with pytest.raises(ForgedError):
            verify(ANN.public, "fact", b"data", changed)


def test_a_signature_with_the_group_s_order_added_is_refused() -> None:
    """S + L verifies where nobody checks that S < L: a second signature of the same thing (RFC 8032, 5.1.7)."""
    order = 2**252 + 27742317777372353535851937790883648493
    signature = ANN.sign("fact", b"data")
    other = signature[:32] + (int.from_bytes(signature[32:], "little") + order).to_bytes(32, "little")

    with pytest.raises(ForgedError):
        verify(ANN.public, "fact", b"data", other)


@given(st.binary(max_size=70).filter(lambda key: key != ANN.public), st.binary(max_size=70))
def test_any_bytes_as_key_and_signature_are_forged_and_nothing_worse(key: bytes, signature: bytes) -> None:
    for public, said in ((key, ANN.sign("fact", b"data")), (ANN.public, signature), (key, signature)):
        with pytest.raises(ForgedError):
            verify(public, "fact", b"data", said)


@pytest.mark.parametrize("sign_bit", [0, 1])
@pytest.mark.parametrize(
    "key",
    [
        "01" + 31 * "00",
        32 * "00",
        "ec" + 30 * "ff" + "7f",
        "26e8958fc2b227b045c3f489f2ef98f0d5dfac05d3c63339b13802886d53fc05",
        "c7176a703d4dd84fba3c0b760d10670f2a2053fa2c39ccc64ec7fd7792ac037a",
        "ed" + 30 * "ff" + "7f",
        "ee" + 30 * "ff" + "7f",
    ],
)
def test_a_key_for_which_anybody_can_sign_is_none(key: str, sign_bit: int) -> None:
    """A point of small order: R = 0, S = 0 then signs one message in eight at least, without any private key."""
    public = bytearray.fromhex(key)
    public[31] |= sign_bit << 7
    anybody = b"\x01" + bytes(63)

    for number in range(64):
        with pytest.raises(ForgedError):
            verify(bytes(public), "fact", bytes([number]), anybody)


def test_the_library_itself_takes_a_key_for_which_anybody_can_sign() -> None:
    """If this ever fails, `verify` need not look for such keys."""
    Ed25519PublicKey.from_public_bytes(b"\x01" + bytes(31)).verify(b"\x01" + bytes(63), b"anything")


def test_two_new_identities_are_two() -> None:
    assert Identity.make().public != Identity.make().public


@given(st.binary(min_size=PUBLIC_BYTES, max_size=PUBLIC_BYTES))
def test_a_public_key_is_43_letters_and_comes_back(public: bytes) -> None:
    text = to_text(public)

    assert len(text) == 43
    assert set(text) <= set("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_")
    assert from_text(text) == public


def test_a_fingerprint_is_the_whole_public_key() -> None:
    assert from_text(ANN.fingerprint) == ANN.public


@pytest.mark.parametrize(
    "spoil",
    [
        lambda text: "",
        lambda text: text[:-1],
        lambda text: text + "A",
        lambda text: text + "=",
        lambda text: text + "\n",
        lambda text: " " + text[1:],
        lambda text: "+" + text[1:],
        lambda text: "/" + text[1:],
        lambda text: "é" + text[1:],
        lambda text: "\udc80" + text[1:],
        lambda text: text[:-1] + chr(ord(text[-1]) + 1),
    ],
)
def test_a_fingerprint_is_written_in_one_way_only(spoil: Callable[[str], str]) -> None:
    """The last letter carries 4 bits: three others would decode to the same key."""
    with pytest.raises(InputError, match="is no public key; it has 43 letters"):
        from_text(spoil(ANN.fingerprint))


@given(st.text(max_size=60))
def test_any_text_is_a_public_key_or_an_input_error(text: str) -> None:
    try:
        public = from_text(text)
    except InputError:
        return
    assert to_text(public) == text
