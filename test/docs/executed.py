"""docs/examples/: pages whose Python blocks are run in order; the block of text behind one is what it prints.

python -m test.docs.executed          runs all pages and writes output and figures anew
"""

import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import chdir, contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from test.conftest import REPOSITORY

PAGES = sorted((REPOSITORY / "docs" / "examples").glob("*.md"))
FIGURES = REPOSITORY / "docs" / "images" / "examples"
BLOCK = re.compile(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)


@contextmanager
def executed(page: Path) -> Iterator[tuple[str, list[Path]]]:
    """The page with the output of this run, and the figures that it saved."""
    names: dict[str, Any] = {"__name__": page.stem}

    def run(block: re.Match[str]) -> str:
        with redirect_stdout(StringIO()) as out:
            exec(compile(block[1], str(page), "exec"), names)
        output = "\n".join(line.rstrip() for line in out.getvalue().splitlines())
        return f"```python\n{block[1]}```\n" + (f"\n```text\n{output}\n```\n" if output else "")

    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        Path("bags").symlink_to(REPOSITORY / "bags")
        text = BLOCK.sub(run, page.read_text())
        yield text, sorted(Path(folder).glob("*.png"))


if __name__ == "__main__":
    FIGURES.mkdir(exist_ok=True)
    for page in PAGES:
        with executed(page) as (text, figures):
            page.write_text(text)
            for figure in figures:
                shutil.copy(figure, FIGURES)
    sys.exit(0)
