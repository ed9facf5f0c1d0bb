"""The lock file names each package with its version and the hash of its file, and the bill of materials says the same."""

import json
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
LINE = re.compile(r"([\w.-]+)==([\w.!+-]+) --hash=sha256:([0-9a-f]{64})")


def locked() -> dict[str, tuple[str, str]]:
    """Version and hash by name."""
    found: dict[str, tuple[str, str]] = {}
    for line in (REPOSITORY / "requirements.lock").read_text().splitlines()[1:]:
        match = LINE.fullmatch(line)
        assert match, line
        found[match[1]] = match[2], match[3]
    return found


def test_every_package_has_a_version_and_a_hash_and_is_installed_in_that_version() -> None:
    packages = locked()
    assert len(packages) > 100
    assert {name: version(name) for name in packages} == {name: pinned for name, (pinned, _) in packages.items()}


def test_pip_is_told_to_refuse_what_has_another_hash() -> None:
    (command,) = [line for line in (REPOSITORY / "Makefile").read_text().splitlines() if "-r requirements.lock" in line]
    assert "--require-hashes" in command


def test_the_bill_of_materials_has_all_that_is_locked_and_nothing_else(tmp_path: Path) -> None:
    paths = [tmp_path / "first.json", tmp_path / "second.json"]
    for path in paths:
        subprocess.run([sys.executable, REPOSITORY / ".ci" / "sbom", path], check=True)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    document = json.loads(paths[0].read_bytes())
    assert (document["bomFormat"], document["specVersion"]) == ("CycloneDX", "1.6")
    assert document["metadata"]["component"]["name"] == "contact_curation"
    components = {one["name"]: (one["version"], one["hashes"][0]["content"]) for one in document["components"]}
    assert components == locked()
    assert len({one["bom-ref"] for one in document["components"]}) == len(components)
    assert all(one["purl"].startswith("pkg:pypi/") for one in document["components"])
