"""The documentation is built as `make docs` builds it: a broken link, a lost page or a docstring that cannot be read ends it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "--builder", "html", "--fail-on-warning", "--keep-going", "--quiet", DOCS, made]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return made


def test_every_page_is_built(site: Path) -> None:
    pages = {path.relative_to(DOCS).with_suffix("") for path in (*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb"))}

    assert {path.relative_to(site).with_suffix("") for path in site.rglob("*.html")} >= pages


def test_the_reference_is_made_of_the_docstrings(site: Path) -> None:
    page = (site / "reference" / "api.html").read_text(encoding="utf-8")

    for name in ("arena.Action", "arena.Observation.find_flag", "arena.policy.BatchPolicy.act", "arena.envs.SingleCapture.step"):
        assert f'id="{name}"' in page, name


def test_the_notebook_ran_from_top_to_bottom(site: Path) -> None:
    page = (site / "tutorials" / "arena.html").read_text(encoding="utf-8")

    assert page.count('class="cell_output') >= 8
    assert re.search(r'<img [^>]*src="[^"]*\.gif"', page)  # it looked
    assert "last.safetensors" in page  # it trained
    assert re.search(r"rush\s.*\n.*walker", page)  # it entered a league


def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    page = (site / "index.html").read_text(encoding="utf-8")

    assert 'src="http' not in page
    assert '<link rel="stylesheet" type="text/css" href="http' not in page
