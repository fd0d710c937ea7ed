"""A missing extra is one sentence; a mistake of ours stays one."""

from importlib import import_module

import pytest

from arena.errors import InputError
from arena.extras import needs


def test_a_missing_package_is_a_sentence_with_the_command_that_installs_it() -> None:
    with (
        pytest.raises(InputError, match=r"^a wolf needs wolfpack, which is not installed here: pip install 'arena-pit\[pack\]'$"),
        needs("pack", "a wolf"),
    ):
        import_module("wolfpack.howl")


def test_a_missing_module_of_our_own_is_a_bug_and_stays_one() -> None:
    with pytest.raises(ModuleNotFoundError, match=r"arena\.wolf"), needs("pack", "a wolf"):
        import_module("arena.wolf")
