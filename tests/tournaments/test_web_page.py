import socket
import subprocess
from collections.abc import Callable
from pathlib import Path


def test_a_pit_whose_page_cannot_be_served_does_not_open(
    here: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]

        refused = here("serve", "--web", port, "--data", tmp_path)

    assert refused.returncode == 2
    assert refused.stderr == (
        f"arena: the web page cannot listen at 127.0.0.1:{port}: Address already in use; choose another address or port\n"
    )
    assert not list(tmp_path.iterdir())
