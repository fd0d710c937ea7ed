"""The `arena` command: every sub-command that ships, composed where imports may point at all that it needs.

The modules that are imported here import no more than `typer` and `arena.console` themselves, so that `arena --help` stays quick.
"""

from arena.cli import Command, make_app, rules, run
from arena.display.cli import replay
from arena.keyring.cli import keys
from clients.commands.admin import admin
from clients.commands.export import export_match
from clients.commands.join import join
from clients.commands.relay import relay
from clients.commands.submit import submit
from clients.commands.watch import watch
from policies.cli import policies
from policies.training.cli import train
from tournaments.commands.backup import backup, restore
from tournaments.commands.bench import bench
from tournaments.commands.check import check
from tournaments.commands.debug import debug
from tournaments.commands.doctor import doctor
from tournaments.commands.evaluate import evaluate
from tournaments.commands.gauntlet import gauntlet
from tournaments.commands.league import leaderboard, tournament
from tournaments.commands.new import new
from tournaments.commands.play import play
from tournaments.commands.season import season
from tournaments.commands.serve import serve
from tournaments.commands.web import web
from tournaments.commands.worker import worker

replay.command("export")(export_match)  # it draws with the web page's scripts, so it stands above `arena.display`

COMMANDS: dict[str, Command] = {
    "admin": admin,
    "backup": backup,
    "bench": bench,
    "check": check,
    "debug": debug,
    "doctor": doctor,
    "evaluate": evaluate,
    "gauntlet": gauntlet,
    "join": join,
    "keys": keys,
    "leaderboard": leaderboard,
    "new": new,
    "play": play,
    "policies": policies,
    "relay": relay,
    "replay": replay,
    "restore": restore,
    "rules": rules,
    "season": season,
    "serve": serve,
    "submit": submit,
    "tournament": tournament,
    "train": train,
    "watch": watch,
    "web": web,
    "worker": worker,
}
app = make_app(COMMANDS)


def main() -> None:
    """Run `arena`, and turn what went wrong into one sentence and an exit code."""
    run(app)
