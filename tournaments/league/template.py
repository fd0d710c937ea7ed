"""What `arena tournament init` writes: a league's file with every key and its default."""

from pathlib import Path

from arena.errors import InputError
from arena.game.ruleset import RULESETS
from arena.sandbox.limits import BEHIND_A_WALL
from tournaments.league.league import DEFAULT_TERMS, League

LIMITS = "".join(f"# {line.replace('=', ' = ')}\n" for line in BEHIND_A_WALL.assignments())

TEMPLATE = f"""\
# A league: arena tournament run THIS.toml
# Stopped at any moment, it goes on where it was when it is run again. Entries may be edited, added and taken out, and pairs
# raised, at any time: only what is new is played. Rules, secret and clock may not be edited once results are stored.

# name = "friday"         # the file's own name without it; letters, digits, - and _

ruleset = "paper"         # {", ".join(RULESETS)}, or a file
pairs = {League.n_pairs}                # of each fixture; a pair is two matches, sides swapped
pairing = "round-robin"   # or "gauntlet", with challenger = "NAME": one against all others; or "sprt", see below
maps = "paired"           # or "fresh": no map twice, for programs and others who remember from match to match
venue = "network"         # every entry and the referee a process of its own
                          # or "local": fighters of the arena in one process, no clock; or "ray": local, spread over a cluster
# listen = "tcp/0.0.0.0:7447"   # where entries join that come by themselves; a free port of this machine alone without it

# seed = 1                # makes the league reproducible, and guessable by anyone; without it, a secret is made and kept

turn_time_s = {DEFAULT_TERMS.turn_time_s}         # for each turn; 0 runs no clock
bank_s = {DEFAULT_TERMS.bank_s}             # extra time of a seat, for a whole match
grace_s = {DEFAULT_TERMS.grace_s}            # how long a seat may be away in a match
# slots = 8               # matches that an entry plays at once; as many as this machine can think for without it

sandbox = "bubblewrap"    # files and programs play behind a wall, where nothing of this machine is to be seen; or "none"
# trusted = ["mine"]      # entries that need no wall

# [rules]                 # what differs from the ruleset, as `arena rules paper` shows it
# tick_limit = 150
# [rules.units.ugv]
# sight = 5

# [limits]                # of each process of a file or program
{LIMITS}
# [season]                # a season: entries are submitted, and chosen pairs are played: arena season open THIS.toml
# submissions = "tcp/0.0.0.0:7448"    # where authors submit
# deadline = 2027-01-31T18:00:00Z     # then the final is played; docs/reference/league-file.md has the other terms

# [sprt]                  # pairing = "sprt": is the first of two entries, or challenger = "NAME", better than the other?
# elo0 = 0                # "no": at most so much better, in Elo
# elo1 = 50               # "yes": at least so much better; the nearer both are, the more pairs it takes
# alpha = 0.05            # how often "yes" may be said of one that is no better than elo0
# beta = 0.05             # how often "no" may be said of one that is elo1 better
                          # it stops at the pair that decides; `pairs` is the most that are played

[entries]                 # a name, and a policy of `arena policies`, a bot file or checkpoint beside this one, or a program
rush = "rush"
patrol = "patrol"
# mine = "mybot.py"
# trained = "best.safetensors"
# other = "exec:java -jar other.jar"   # the files that it names begin at this one's folder, too; needs maps = "fresh"
# far = "key:PUBLICKEY"   # joins by itself, from wherever it is; `arena keys show` prints the key of an entry
"""


def write_template(file: Path) -> None:
    """Write the template into a new file.

    Raises
    ------
    InputError
        The file is there already, or cannot be written, or would not be known for a league's.
    """
    if file.suffix != ".toml":
        raise InputError(f"{file} does not end in .toml, by which a league's file is known")
    try:
        with file.open("x", encoding="utf-8") as written:
            written.write(TEMPLATE)
    except FileExistsError as error:
        raise InputError(f"{file} is there already") from error
    except OSError as error:
        raise InputError(f"cannot write {file}: {error.strerror}") from error
