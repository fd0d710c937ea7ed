"""Asking a pit, with real sessions over loopback."""

from arena.network.address import Address, free_port
from arena.network.asking import ask
from arena.network.session import Query, open_client, open_router


def test_a_query_that_is_left_unanswered_is_sent_again() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    asked: list[bytes] = []

    def answer(question: Query) -> None:
        asked.append(question.payload)
        if len(asked) > 1:
            question.answer(b"here")
        else:
            question.drop()

    with open_router(endpoint, "pit") as router, open_client(endpoint) as client:
        router.answer("arena/pit/lobby", answer)

        assert ask(client, Address(endpoint=endpoint), "arena/pit/lobby", b"who?") == b"here"

    assert asked == [b"who?"] * 2
