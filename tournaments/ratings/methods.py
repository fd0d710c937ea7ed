"""The rating methods by their names: our own, and those of other people's packages, entry points of the group `arena.ratings`."""

from collections.abc import Sequence
from inspect import Parameter, signature
from typing import Protocol

from arena.errors import InputError
from tournaments.outcome import Outcome
from tournaments.plug_ins import find_plug_in
from tournaments.ratings.rate import N_DRAWS, Follows, Ratings, rate, rate_normal

GROUP = "arena.ratings"
"""An entry point of it is a `RatingMethod`."""
DEFAULT = "davidson"


class RatingMethod(Protocol):
    """Makes ratings of a league's results; the order of the results must not matter."""

    def __call__(
        self,
        names: Sequence[str],
        outcomes: Sequence[Outcome],
        *,
        are_maps_fresh: bool = False,
        n_draws: int = N_DRAWS,
        follows: Follows = (),
    ) -> Ratings:
        """Rate every entry of `names`, with matches or without; `n_draws` is the effort that intervals are worth.

        `follows` is given where versions of one entry are rated beside each other, and only then.
        """


_OWN: dict[str, RatingMethod] = {DEFAULT: rate, "normal": rate_normal}


def find_method(name: str = DEFAULT) -> RatingMethod:
    """Return a rating method; `InputError` if there is none of that name."""
    return find_plug_in(GROUP, "rating method", _OWN, name)


def check_versions(method: RatingMethod, name: str) -> None:
    """Check that a method can rate versions of an entry beside each other; `InputError` if it is of before there were any."""
    parameters = signature(method).parameters.values()
    if not any(one.name == "follows" or one.kind is Parameter.VAR_KEYWORD for one in parameters):
        raise InputError(f"the rating method {name} cannot rate versions: it takes no follows; leave out --all-versions, or it")
