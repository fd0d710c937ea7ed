"""The operator's commands to a running pit, signed with the pit's own key."""

from pathlib import Path

from arena.errors import KeyFileError, RefusedError
from arena.network.address import Address
from arena.network.asking import ask
from arena.network.session import open_client
from arena.protocol import topics
from arena.protocol.handshake import Attempt
from arena.protocol.identity import Identity, to_text
from arena.protocol.messages import AdminRequest, Done, Refusal
from clients.lobby import ask_challenge


def send_command(address: Address, authority: Path | None, identity: Identity, name: str, target: str) -> str:
    """Have the pit carry out a command, and return what it did.

    Raises
    ------
    KeyFileError
        The key is not the pit's.
    RefusedError
        The pit says no.
    LostPitError
        No pit answers.
    """
    with open_client(address.endpoint, authority) as session:
        challenge = ask_challenge(session, address)
        if challenge.pit_key != identity.public:
            raise KeyFileError(
                f"the pit's key is {to_text(challenge.pit_key)}, and this is {identity.fingerprint}; name the --data of that pit"
            )
        attempt = Attempt(identity, address.pit, challenge, AdminRequest(command=name, target=target))
        answer = attempt.open(ask(session, address, topics.join(address.pit), attempt.sealed))
    if isinstance(answer, Done):
        return answer.text
    raise RefusedError(f"the pit says no: {answer.reason if isinstance(answer, Refusal) else 'it answers something else'}")
