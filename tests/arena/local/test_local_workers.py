"""What jobs send from other processes."""

from functools import partial

from arena.local.workers import send_to_parent, work

LONG = "x" * 300_000
"""More than a pipe takes in one piece."""


def send_long_messages(job: int) -> int:
    for number in range(40):
        send_to_parent((job, number, LONG))
    return job


def test_long_messages_of_several_workers_arrive_whole() -> None:
    heard: list[tuple[object, ...]] = []

    done = list(work([partial(send_long_messages, job) for job in range(4)], 2, heard.append))

    assert sorted(done) == [0, 1, 2, 3]
    assert sorted(heard) == [(job, number, LONG) for job in range(4) for number in range(40)]
