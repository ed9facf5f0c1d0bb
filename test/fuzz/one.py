"""One target under atheris: python -m test.fuzz.one TARGET [libFuzzer's options] [corpora]; started by test.fuzz.run."""

import os
import sys
import time
import warnings
from pathlib import Path

for library in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(library, "1")

import atheris  # noqa: E402

LIBRARIES = {"mcap": ["mcap", "rosbags"], "sqlite": ["rosbags"], "ros1": ["rosbags"], "mesh": ["trimesh"]}
SLOWEST = 5.0
"""[s] of processor time for one input."""
INSTRUMENTED = ["contact_curation", *LIBRARIES.get(sys.argv[1], [])]

with atheris.instrument_imports(include=INSTRUMENTED):
    from test.fuzz import targets


def main() -> None:
    """Reads the seeds once, so that what is imported late is instrumented and loaded, then fuzzes."""
    name = sys.argv.pop(1)
    warnings.simplefilter("ignore")
    with atheris.instrument_imports(include=INSTRUMENTED):
        for seed in sorted((Path(__file__).parent / "corpus" / name).iterdir()):
            targets.read(name, seed.read_bytes())

    def one(data: bytes) -> None:
        began = time.process_time()
        targets.read(name, data)
        took = time.process_time() - began
        if took > SLOWEST:
            raise TimeoutError(f"{took:.1f} s of processor time for {len(data)} bytes")

    atheris.Setup(sys.argv, one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
