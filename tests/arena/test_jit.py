"""Where compiled kernels are kept."""

import logging
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from arena import jit

Place = Callable[[object], None]


def add_one(number: int) -> int:
    return number + 1


@pytest.fixture
def place(monkeypatch: pytest.MonkeyPatch) -> Iterator[Place]:
    """Put the cache elsewhere."""

    def put(folder: object) -> None:
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder))
        jit._cache_folder.cache_clear()
        jit._can_write.cache_clear()

    yield put
    jit._cache_folder.cache_clear()
    jit._can_write.cache_clear()


def test_a_kernel_is_kept_under_the_folder_that_was_named(place: Place, tmp_path: Path) -> None:
    place(tmp_path)

    compiled = jit.jit()(add_one)

    assert compiled(1) == 2
    assert len(list(tmp_path.rglob("*.nbc"))) == 1


def test_a_folder_that_cannot_be_written_means_no_cache_and_one_warning(
    place: Place, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    """numba would keep it beside the source instead, and not notice that another module changed."""
    (tmp_path / "file").touch()
    place(tmp_path / "file")

    with caplog.at_level(logging.WARNING):
        kernels = [jit.jit()(add_one) for _ in range(3)]

    assert [kernel(1) for kernel in kernels] == [2, 2, 2]
    assert {kernel.stats.cache_path for kernel in kernels} == {None}  # type: ignore[attr-defined]
    assert [record.getMessage() for record in caplog.records] == [
        f"kernels are compiled anew at each start: cannot write to {tmp_path / 'file'}: File exists"
    ]
