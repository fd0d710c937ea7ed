"""Bots that are after everything but the flag. Each says "LOOT" and what it got, on stderr, which ends in its client's log."""

COMMON = """
import glob, os, signal, socket, subprocess, sys, threading, time
from pathlib import Path

def loot(what):
    print("LOOT", what, file=sys.stderr, flush=True)

def stay(seen):
    return [0] * len(seen.units)
"""

READS_FILES = """
def act(seen):
    if seen.tick == 0:
        names = {names!r}
        for root, folders, files in os.walk("/"):
            if root.startswith(("/proc", "/usr")) or root.endswith("site-packages"):  # everybody has what is in there
                folders[:] = []
                continue
            for file in files:
                if file in names or file.endswith((".journal", ".key", ".db", ".toml.secret", ".transcript")):
                    loot(os.path.join(root, file))
        for name in ("PGPASSWORD", "ARENA_CONFIG", "ARENA_TEST_SECRET"):
            if name in os.environ:
                loot(name)
        for path in {paths!r}:
            for way in (path, "/proc/1/root" + path, "/proc/self/root" + path, os.path.relpath(path)):
                if os.path.exists(way):
                    loot(way)
    return stay(seen)
"""

READS_PROCESSES = """
def act(seen):
    if seen.tick == 0:
        for folder in glob.glob("/proc/[0-9]*"):
            for file in ("environ", "cmdline"):
                try:
                    said = Path(folder, file).read_bytes()
                except OSError:
                    continue
                if b"--key" in said or b"ARENA_TEST_SECRET" in said or b"PGPASSWORD" in said:
                    loot(folder + file)
    return stay(seen)
"""

OPENS_SOCKETS = """
def act(seen):
    if seen.tick == 0:
        for port in [*range(1, 1024, 111), *range(7000, 8000), {port}]:
            with socket.socket() as tried:
                tried.settimeout(0.05)
                if tried.connect_ex(("127.0.0.1", port)) == 0:
                    loot(port)
        for line in Path("/proc/net/unix").read_text().splitlines()[1:]:
            path = line.split()[-1]
            if path.startswith(("/", "@")):
                with socket.socket(socket.AF_UNIX) as tried:
                    if tried.connect_ex(path.replace("@", chr(0), 1)) == 0:
                        loot(path)
        import zenoh
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", '["tcp/127.0.0.1:{port}"]')
        config.insert_json5("connect/timeout_ms", "200")
        try:
            zenoh.open(config)
        except zenoh.ZError:
            return stay(seen)
        loot("a session as somebody else")
    return stay(seen)
"""

WRITES = """
def act(seen):
    if seen.tick == 0:
        import arena, numba
        kernels = os.environ["NUMBA_CACHE_DIR"]
        places = [__file__, arena.__file__, numba.__file__, kernels + "/x", *glob.glob(kernels + "/**/*.nb?", recursive=True)[:3],
                  "/etc/passwd", "/proc/sys/kernel/core_pattern", "/proc/self/uid_map"]
        for path in {paths!r}:
            try:
                Path(path).parent.mkdir(parents=True, exist_ok=True)
                Path(path).write_text("x")  # behind a wall, a file of its own at most; the host looks whether its own has changed
            except OSError:
                continue
        for place in places:
            try:
                with open(place, "ab") as file:
                    file.write(b"x")
            except OSError:
                continue
            loot(place)
    return stay(seen)
"""

FORKS = """
def act(seen):
    if seen.tick == 1:
        while True:
            try:
                if os.fork() == 0:
                    while True:
                        os.fork()
            except OSError:
                continue
    return stay(seen)
"""

ALLOCATES = """
def act(seen):
    if seen.tick == 1:
        hoard = [bytearray(1 << 28) for _ in range(80)]
        loot(len(hoard))
    return stay(seen)
"""

FILLS_THE_DISK = """
def act(seen):
    if seen.tick == 1:
        for folder in (os.environ["HOME"], "/tmp", "/dev/shm", "/var/tmp", "."):
            try:
                with open(folder + "/x", "wb") as file:
                    for n in range(1000):
                        file.write(bytes(1 << 20))
                        file.flush()
            except OSError:
                continue
            loot(folder)
    return stay(seen)
"""

SHOUTS = """
def act(seen):
    if seen.tick == 1:
        for _ in range(1 << 10):
            print("x" * (1 << 20))
    return stay(seen)
"""

OUTLIVES = """
for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
    signal.signal(number, signal.SIG_IGN)

def act(seen):
    if seen.tick == 0 and os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            os.execvp(sys.executable, [sys.executable, "-c", "import time; time.sleep(10000)", {mark!r}])
        os._exit(0)
    return stay(seen)
"""

LOOPS = """
def act(seen):
    while seen.tick >= 3:
        pass
    return stay(seen)
"""

TRACES = """
import ctypes

def act(seen):
    if seen.tick == 0:
        libc = ctypes.CDLL(None, use_errno=True)
        for pid in (os.getppid(), *{pids!r}):
            if pid != 1 and libc.ptrace(16, pid, 0, 0) == 0:
                loot(pid)
            for number in (signal.SIGTERM, signal.SIGSTOP, signal.SIGKILL):
                try:
                    os.kill(pid, number)
                except (ProcessLookupError, PermissionError):
                    continue
                if pid in {pids!r}:
                    loot("a signal to " + str(pid))
        os.kill(-1, signal.SIGKILL)
    return stay(seen)
"""

LEAVES_LINKS = """
def act(seen):
    if seen.tick == 0:
        for number, target in enumerate({paths!r}):
            for folder in (".", "/tmp", os.path.dirname(__file__)):
                try:
                    os.symlink(target, folder + "/limits-met" + str(number))
                    os.symlink(target, folder + "/limits-met")
                except OSError:
                    continue
        libc = __import__("ctypes").CDLL(None)
        if libc.mount(b"none", b"/tmp", b"tmpfs", 0, 0) == 0 or libc.unshare(0x10000000) == 0 or libc.chroot(b"/proc") == 0:
            loot("a mount")
    return stay(seen)
"""

WRITES_JUNK = """
def act(seen):
    if seen.tick == 2:
        for descriptor in range(3, 30):
            try:
                os.write(descriptor, os.urandom(1 << 16))
            except OSError:
                continue
    return stay(seen)
"""

BOTS = {
    "reads_files": READS_FILES,
    "reads_processes": READS_PROCESSES,
    "opens_sockets": OPENS_SOCKETS,
    "writes": WRITES,
    "forks": FORKS,
    "allocates": ALLOCATES,
    "fills_disks": FILLS_THE_DISK,
    "shouts": SHOUTS,
    "outlives": OUTLIVES,
    "loops": LOOPS,
    "traces": TRACES,
    "leaves_links": LEAVES_LINKS,
    "writes_junk": WRITES_JUNK,
}


def source_of(name: str, **facts: object) -> str:
    """Return the code of a bot that knows some facts of the machine, which it could have guessed."""
    code = BOTS[name]
    for key, value in facts.items():
        code = code.replace("{" + key + "!r}", repr(value)).replace("{" + key + "}", str(value))
    return COMMON + code
