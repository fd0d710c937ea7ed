"""The page of a course, followed from top to bottom by real processes: a season opens, a bot is submitted, all is backed up."""

import json
import re
import signal
import socket
import subprocess
import urllib.request
from collections.abc import Callable
from pathlib import Path

import pytest
from commands import Command, nursery, quick_arena, quick_start
from pages import FILES, PAGES, steps, words

from tournaments.store.season_store import SeasonStore

start, arena = quick_start, quick_arena
__all__ = ["arena", "nursery", "start"]  # fixtures
PAGE = PAGES["docs/how-to/course.md"]
ELSEWHERE = ("arena doctor",)
"""Begins lines that tests/contracts/test_pages.py runs."""


def free_ports(n: int) -> list[int]:
    probes = [socket.socket() for _ in range(n)]
    try:
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return [int(probe.getsockname()[1]) for probe in probes]
    finally:
        for probe in probes:
            probe.close()


def test_the_page_of_a_course_can_be_followed(
    start: Callable[..., Command],
    arena: Callable[..., subprocess.CompletedProcess[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    submissions, metrics = free_ports(2)
    Path("mybot.py").write_text(FILES["mybot.py"])
    course = FILES["course.toml"].replace("0.0.0.0:7448", f"127.0.0.1:{submissions}")
    # Nobody to play against, so that the check has the processor.
    Path("course.toml").write_text(course.replace('[entries]\nrush = "rush"\npatrol = "patrol"\n', ""))
    said: dict[str, str] = {}
    season, address = None, ""
    for line in (step.line for step in steps(PAGE) if step.line and step.line.startswith("arena ")):
        if line.startswith(ELSEWHERE):
            continue
        typed = [word.replace("ADDRESS", address).replace("127.0.0.1:9101", f"127.0.0.1:{metrics}") for word in words(line)]
        if line.startswith("arena season open"):
            season = start(*typed).wait_for("is open: arena submit BOT --to ")
            address = season.said.split("--to ")[1].split()[0]
        elif line.startswith("arena web"):
            page = start(*typed, "--port", 0).wait_for("web page at ")
            where = page.said.split("web page at http://")[1].split("/")[0]
            asked = urllib.request.Request(f"http://127.0.0.1:{where.rpartition(':')[2]}/healthz", headers={"Host": where})
            with urllib.request.urlopen(asked, timeout=30) as answer:
                assert answer.status == 200
        else:
            done = arena(*typed)
            assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
            said[line] = done.stdout

    assert season is not None, "the page opens no season"
    with urllib.request.urlopen(f"http://127.0.0.1:{metrics}/metrics", timeout=30) as answer:
        counted = dict(re.findall(r"^(arena_(?:store|seat_p99)_seconds_count) (\S+)$", answer.read().decode(), re.MULTILINE))
        assert float(counted["arena_store_seconds_count"]) > 0
        assert float(counted["arena_seat_p99_seconds_count"]) % 2 == 0
    season.send(signal.SIGTERM)
    assert season.finish() == 0
    assert "version 1 of mybot plays from now on" in said["arena submit mybot.py --to ADDRESS"]
    assert "mybot" in said["arena season status autumn --data course"]
    with SeasonStore("restored/arena.db", make=False) as restored, SeasonStore("course/arena.db", make=False) as store:
        kept, all_of_it = (opened.identities(opened.get("autumn")) for opened in (restored, store))
        assert kept <= all_of_it
        assert json.dumps(restored.get("autumn").definition) == json.dumps(store.get("autumn").definition)
