import json
from pathlib import Path

import pytest

from arena.errors import InputError
from benchmarks.measuring.load import Load, draw, read_loads


def test_a_result_is_read_from_the_fewest_matches_on(tmp_path: Path) -> None:
    rows = {f"matches_{n}": {"as_fast_as_can_be": {"turns_per_s": n, "bare_zenoh": {"turns_per_s": 2 * n}}} for n in (64, 1)}
    file = tmp_path / "result.json"
    file.write_text(json.dumps({"pit": {"workers": 1, **rows}}))

    loads = read_loads(file)
    assert loads == [Load(1, 1.0, 2.0), Load(64, 64.0, 128.0)]
    assert draw(loads) == draw(loads)
    assert b"bare Zenoh" in draw(loads)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"pit": {"matches_1": {}}}'])
def test_what_is_no_result_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "result.json").write_text(text)

    with pytest.raises(InputError, match=r"give .*what `arena bench pit --json` prints|give a file that holds that"):
        read_loads(tmp_path / "result.json")
