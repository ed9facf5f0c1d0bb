"""Ranking a polytope needs no optional library; where one is missing, one line says which extra installs it."""

import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

import contact_curation as cc
from contact_curation.errors import MissingDependencyError
from contact_curation.extras import EXTRA_OF, missing_extra, says_what_to_install
from test.conftest import REPOSITORY
from test.kernel.builds import setup_module

GOLDEN = REPOSITORY / "bags" / "golden.mcap"
WITHOUT_EXTRAS = f"""
import sys
sys.modules.update(dict.fromkeys({sorted(EXTRA_OF)}))
from contact_curation.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


def run(*words: str) -> subprocess.CompletedProcess[str]:
    """The command line, in a process that can import no optional library."""
    return subprocess.run([sys.executable, "-c", WITHOUT_EXTRAS, *words], capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_polytope_is_ranked_without_any_extra(tmp_path: Path) -> None:
    done = run("rank", str(GOLDEN), "--top", "3", "--out", str(tmp_path / "ranked.csv"))
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "ranked.png").is_file()


@pytest.mark.slow
def test_a_recording_is_checked_without_any_extra() -> None:
    done = run("check", str(GOLDEN))
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("ok: 21 of 24 motions are sound tosses of cube\n")


def test_training_without_torch_ends_in_one_line_with_the_remedy(tmp_path: Path) -> None:
    done = run("train", str(GOLDEN), "--out", str(tmp_path / "model.safetensors"))
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == ("contact-curation: error: torch is missing: pip install 'contact-curation[train]'")
    assert "Traceback" not in done.stderr


def test_python_gets_the_same_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingDependencyError, match=r"^torch is missing: pip install 'contact-curation\[train\]'$"):
        cc.train(str(GOLDEN))


def test_another_missing_module_is_a_mistake_of_ours_and_keeps_its_name() -> None:
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        says_what_to_install(lambda: __import__("no_such_module"))()


def test_a_library_that_is_installed_but_incomplete_is_not_called_missing() -> None:
    error = ModuleNotFoundError("No module named 'torch.gone'", name="torch.gone")
    with pytest.raises(ModuleNotFoundError, match="gone"):
        missing_extra(error)


def test_every_optional_library_is_in_the_extra_that_is_named() -> None:
    extras = {name: " ".join(needed).replace("-", "_") for name, needed in setup_module().EXTRAS.items()}
    installed = packages_distributions()
    for library, extra in EXTRA_OF.items():
        names = {name.replace("-", "_") for name in installed[library]} | {library}
        if library in ("rclpy", "nav_msgs", "sensor_msgs"):
            names = {"ros_jazzy_rclpy", "ros_jazzy_common_interfaces"}  # they bring these
        assert any(name in extras[extra] for name in names), (library, names)


def test_a_library_that_the_system_cannot_load_is_one_line() -> None:
    error = ImportError("libtorch_cpu.so: failed to map segment", name="torch._C", path="/site/torch/_C.so")
    assert str(missing_extra(error)).startswith("/site/torch/_C.so: cannot be loaded: libtorch_cpu.so: failed to map segment; ")


def test_a_name_that_a_module_lacks_is_a_mistake_of_ours() -> None:
    def wrong() -> None:
        exec("from json import no_such_name", {})

    with pytest.raises(ImportError, match="no_such_name"):
        says_what_to_install(wrong)()
