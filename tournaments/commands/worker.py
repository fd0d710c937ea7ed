"""The command that other machines run for a pit: `arena worker`."""


def worker() -> None:
    """Referee matches for a pit on another machine; `arena serve --machine` runs it there by ssh."""
    import sys

    from arena.errors import InputError
    from arena.pit.workers.far_worker import work_afar

    if sys.stdin.isatty():
        raise InputError("arena worker is run by a pit, over ssh; run arena serve --machine HOST=N on the machine of the pit")
    work_afar()
