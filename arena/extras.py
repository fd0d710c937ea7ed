"""Optional parts of the installation, and the sentence for one that is missing."""

from collections.abc import Iterator
from contextlib import contextmanager

from arena.errors import InputError

_OURS = {"arena", "clients", "policies", "tournaments"}


@contextmanager
def needs(extra: str, what: str) -> Iterator[None]:
    """Import packages of an extra inside this block; one that is missing is an `InputError` that names the command.

    Parameters
    ----------
    extra
        The extra of `arena-pit` that installs them, such as "learned".
    what
        What needs them, as the subject of a sentence: "a trained fighter".
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if not package or package in _OURS:
            raise
        raise InputError(f"{what} needs {package}, which is not installed here: pip install 'arena-pit[{extra}]'") from error
