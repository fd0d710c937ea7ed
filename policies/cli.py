"""The sub-command of the fighters: `arena policies`."""

from glob import escape, glob

from arena.console import AsJson, print_json, print_table


def complete_policy(incomplete: str) -> list[str]:
    """Return the fighters, and the files of bots and checkpoints, that begin like `incomplete`, for the shell."""
    from policies.registry import names

    found = [file for end in (".py", ".safetensors") for file in sorted(glob(f"{escape(incomplete)}*{end}"))]  # noqa: PTH207
    return [name for name in names() if name.startswith(incomplete)] + found


def policies(as_json: AsJson = False) -> None:
    """List the fighters, and what each is up to."""
    from policies.registry import REFERENCES, names, plan

    plans = {name: plan(name) for name in [*names(), *REFERENCES]}
    if as_json:
        print_json([{"name": name, "plan": text} for name, text in plans.items()])
    else:
        print_table(("name", "plan"), plans.items())
