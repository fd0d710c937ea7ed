"""The metrics of a run's folder: begun anew where nothing was kept, and refused with a sentence where they are damaged."""

import csv
from pathlib import Path

import pytest

from arena.errors import InputError
from policies.training.folder import METRICS, RunFolder


def rows_of(folder: RunFolder) -> list[dict[str, str]]:
    with (folder.path / METRICS).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("left", [b"", b"\r\n", b"st", b"step,sco", b"step,score\r\n", b"step\r\n\xc2\xb2\r\n"])
def test_metrics_without_a_row_are_begun_anew(tmp_path: Path, left: bytes) -> None:
    folder = RunFolder(tmp_path)
    (tmp_path / METRICS).write_bytes(left)  # a full disk took the rest

    folder.cut_metrics(0)
    folder.add_metrics({"step": 1, "score": 0.5})
    folder.cut_metrics(1)
    folder.add_metrics({"step": 2, "score": 0.25})

    assert rows_of(folder) == [{"step": "1", "score": "0.5"}, {"step": "2", "score": "0.25"}]


def test_a_first_line_that_is_empty_is_no_header(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path)
    (tmp_path / METRICS).write_bytes(b"\r\n")

    for step in (1, 2):
        folder.add_metrics({"step": step, "score": 0.5})

    assert rows_of(folder) == [{"step": "1", "score": "0.5"}, {"step": "2", "score": "0.5"}]


@pytest.mark.parametrize(
    ("damaged", "reason"),
    [
        (b"1,0.5\r\n2,0.25\r\n", "its header is damaged; move it away, and it is begun anew$"),
        (b"step,sc\r\n1,0.5,0.25\r\n", "its header is damaged; move it away, and it is begun anew$"),
        (b"\r\n1,0.5\r\n", "its header is damaged; move it away, and it is begun anew$"),
        (b"step,score\r\n1,\xff\r\n", "'utf-8' codec can't decode byte 0xff .*; move it away, and the run goes on without it$"),
        (b"step,score\r\n1," + b"9" * 200_000, "field larger than field limit .*; move it away, and the run goes on without it$"),
    ],
)
def test_damaged_metrics_are_refused_in_a_sentence_and_stay_as_they_are(tmp_path: Path, damaged: bytes, reason: str) -> None:
    (tmp_path / METRICS).write_bytes(damaged)

    with pytest.raises(InputError, match=rf"metrics\.csv: {reason}"):
        RunFolder(tmp_path).cut_metrics(1)

    assert (tmp_path / METRICS).read_bytes() == damaged
