"""docs/reference/: the formats of files and of JSON output, made of the records and stores that write them.

python -m test.docs.schemas          writes the pages
"""

import inspect
import json
import re
import sys
import tempfile
import textwrap
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import fields, is_dataclass
from io import StringIO
from types import ModuleType
from typing import Any

from contact_curation.cli.main import main
from contact_curation.design.throw import Throw
from contact_curation.experiments.counterfactuals import table
from contact_curation.stages import records
from contact_curation.storage import throws_file
from contact_curation.storage.manifest import file as manifest_file
from contact_curation.storage.manifest.manifest import ManifestRow
from contact_curation.storage.provenance import InputProvenance, RunProvenance
from contact_curation.storage.stores import information, state, tosses
from test.conftest import REPOSITORY

FOLDER = REPOSITORY / "docs" / "reference"
WIDTH = 118
GOLDEN = "bags/golden.mcap"
WRITTEN = "Written by `python -m test.docs.schemas` from the code; a test compares the two."

STORES: Mapping[str, tuple[ModuleType, str]] = {
    "Toss store": (tosses, "`pose_ingest` (`tosses.sqlite`) and `trainer` (`trainer.sqlite`)"),
    "Information store": (information, "`fisher_scorer` (`information.sqlite`) and `curator` (`buffer.sqlite`)"),
    "State store": (state, "nodes that remember small values only, such as `throw_designer` (`throws.sqlite`)"),
}

JSON_COMMANDS = {
    "body": ["body", "contact_curation/config/cube.yaml"],
    "check": ["check", GOLDEN],
    "rank": ["rank", GOLDEN, "--top", "3", "--no-figure"],
    "rig": ["rig", GOLDEN],
    "train": ["train", GOLDEN, "--held-out", "14-20", "--out", "{folder}/cube.safetensors"],
    "evaluate": ["evaluate", "{folder}/cube.safetensors", GOLDEN],
    "score": ["score", GOLDEN, "--params", "{folder}/cube.safetensors", "--out", "{folder}/scores.npz"],
    "design": ["design", "--baseline", "prior", "--throws", "2", "--out", "{folder}/throws.json"],
    "simulate": ["simulate", "{folder}/throws.json", "--out", "{folder}/simulated.mcap"],
    "export": ["export", GOLDEN, "--manifest", "{folder}/ranked.json", "--format", "mcap", "--out", "{folder}/selected"],
}
"""In this order: later ones read what earlier ones wrote."""


def attributes(kind: type) -> dict[str, str]:
    """What the docstring of a record says of each field."""
    text = inspect.cleandoc(kind.__doc__ or "").partition("Attributes:")[2]
    found = re.findall(r"^    (\w+): (.+(?:\n {8}.+)*)", text, re.MULTILINE)
    return {name: " ".join(said.split()) for name, said in found}


def field_list(kind: type) -> Iterator[str]:
    """An entry for each field of a record."""
    said = attributes(kind)
    names = [(field.name, field.type) for field in fields(kind)] if is_dataclass(kind) else list(kind.__annotations__.items())
    for name, of in names:
        text = f"- `{name}` ({type_name(of)}){': ' if name in said else ''}{said.get(name, '').rstrip('.')}"
        yield from textwrap.wrap(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False, break_long_words=False)


def type_name(kind: Any) -> str:
    """Of an annotation, without the modules."""
    text = kind if isinstance(kind, str) else getattr(kind, "__name__", "") if isinstance(kind, type) else str(kind)
    text = str(kind) if "[" in str(kind) and not isinstance(kind, str) else text
    return re.sub(r"\b(?:\w+\.)+(\w+)", r"\1", text).replace("|", "or")


def manifest_page() -> str:
    """The manifest that `rank` writes."""
    lines = ["# Manifest", "", WRITTEN, ""]
    lines += ["`rank --out FILE` and `RankedTosses.save` write it; `train --manifest` and `export --manifest` read it.", ""]
    lines += ["```", *inspect.cleandoc(manifest_file.__doc__ or "").splitlines(), "```", ""]
    lines += [f"The version of the format is {manifest_file.VERSION}; a file of a newer version is refused.", ""]
    lines += ["## A row for each toss", "", *field_list(ManifestRow), ""]
    lines += ["## The head", "", *field_list(RunProvenance), ""]
    lines += ["Each entry of `inputs`:", "", *field_list(InputProvenance), ""]
    return "\n".join([*lines, "`diagnostics` is described with the [JSON of `rank`](json.md#rank).", ""])


def throws_page() -> str:
    """What `design` writes and `simulate` or a robot reads."""
    lines = ["# throws.json", "", WRITTEN, ""]
    lines += ["```", *inspect.cleandoc(throws_file.__doc__ or "").splitlines(), "```", ""]
    lines += [f"A file holds 1 to {throws_file.MOST_THROWS:,} throws; each `throw_id` occurs once.", ""]
    return "\n".join([*lines, "## A throw", "", *field_list(Throw), ""])


def stores_page() -> str:
    """SQLite files of the nodes, and the records in them."""
    lines = ["# Stores", "", WRITTEN, ""]
    lines += ["Every node keeps what it must not lose in one SQLite file. The file's `application_id` names its kind and its"]
    lines += ["`user_version` the version of its tables. A newer version is refused, an older one is upgraded.", ""]
    for title, (module, users) in STORES.items():
        schema = module.SCHEMA
        lines += [
            f"## {title}",
            "",
            f"Of {users}.",
            f"`application_id` 0x{schema.application_id:x}, version {schema.version}.",
            "",
        ]
        lines += ["```sql", *(_wrapped(statement) for statement in schema.statements), "```", ""]
    lines += [
        "These are the nodes' defaults; in a [recorded session](../how-to/online.md) a store is `stores/NODE.sqlite`.",
        "",
    ]
    lines += [
        "`head` is JSON with Python's `Infinity` and `NaN`, which some readers refuse; `extra` is JSON with the source of"
    ]
    lines += ["the record. `arrays` has the length of a JSON list (uint32), the list, an entry `[name, dtype, shape]` for each"]
    lines += ["array, and then their numbers, all little-endian (`record_table.py`). Each blob ends with a CRC-32 over its row"]
    lines += ["(`seal.py`): what a disk changed is refused."]
    lines += ["A node takes its store for itself and looks through all of it when it starts; others may read.", ""]
    lines += [
        "## Records of the nodes",
        "",
        "Values of the table `states`: one JSON object each, with its fields and a `format`",
    ]
    lines += [
        f"(now {records.FORMAT}). The key is the name below; `header` and `first loss` are followed by `/` and a toss's id."
    ]
    lines += [
        "Values of other keys are no JSON: `parameters`, `next_parameters` and `theta` are the bytes of a `.safetensors` file,"
    ]
    lines += ["`model` and `next_model` the name of a kind of model. An empty one stands for none.", ""]
    kinds: list[Any] = [kind for _, kind in inspect.getmembers(records, inspect.isclass) if "KEY" in vars(kind)]
    for kind in kinds:
        lines += [f"### {kind.__name__}, key `{kind.KEY}`", "", inspect.cleandoc(kind.__doc__ or "").splitlines()[0], ""]
        lines += [*field_list(kind), ""]
    return "\n".join(lines)


def json_page() -> str:
    """What `--json` prints, by verb."""
    lines = ["# JSON output", "", WRITTEN, ""]
    lines += ["With `--json` a verb prints one object on standard output and nothing else. The outlines below are those of the"]
    lines += ["commands above them: keys, and the types of their values; where entries of a list differ, all of their types."]
    lines += [
        "A number that is not finite is `null`. Units are SI, unless a name or the [command](../commands.md) says another."
    ]
    lines += ["Keys that are paths, reasons or names of tosses stand for all of their kind.", ""]
    with tempfile.TemporaryDirectory() as folder:
        _output(["rank", GOLDEN, "--top", "3", "--no-figure", "--out", f"{folder}/ranked.json"])
        for verb, words in JSON_COMMANDS.items():
            command = [word.format(folder=folder) for word in words]
            document = json.loads(_output([*command, "--json"]))
            shown = " ".join(word.format(folder="DIR") for word in words)
            held = [line.replace(folder, "DIR") for line in outline(document)]
            lines += [f"## {verb}", "", f"    contact-curation {shown} --json", "", "```", *held, "```", ""]
    return "\n".join(lines)


def outline(*values: Mapping[str, Any], indent: str = "") -> Iterator[str]:
    """The keys of objects of one kind and the types of their values."""
    for name in dict.fromkeys(name for value in values for name in value):
        parts, depth = [value[name] for value in values if name in value], 0
        while any(isinstance(part, list) and part for part in parts):
            parts, depth = [one for part in parts if isinstance(part, list) for one in part], depth + 1
        kinds = dict.fromkeys(map(_json_type, parts))
        kinds = {kind: None for kind in kinds if kind != "integer" or "number" not in kinds}
        yield f"{indent}{name}: {'list of ' * depth}{' or '.join(kinds)}"
        yield from outline(*(part for part in parts if isinstance(part, dict)), indent=indent + "    ")


def _json_type(value: object) -> str:
    kinds = {bool: "true or false", int: "integer", float: "number", str: "text", dict: "object", list: "list"}
    return kinds.get(type(value), "null")


def _wrapped(statement: str) -> str:
    return re.sub(r", (?=[^()]*\)$|[^()]*\(id)", ",\n    ", statement.replace(" (", " (\n    ", 1)) + ";"


def _output(words: list[str]) -> str:
    with redirect_stdout(StringIO()) as out:
        assert main(words) == 0, words
    return out.getvalue()


def counterfactuals_page() -> str:
    """The Parquet file of refits on random subsets."""
    lines = ["# counterfactuals.parquet", "", WRITTEN, ""]
    lines += [
        "`reproduce counterfactuals` writes it: a row for each exact refit on a random subset of a body's training tosses."
    ]
    lines += ["The rows behind the tables of [Results](../results.md) are in `docs/results/counterfactuals.parquet`.", ""]
    for field in table.SCHEMA:
        text = f"- `{field.name}` ({field.type}): {field.metadata[b'description'].decode()}"
        lines += textwrap.wrap(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False, break_long_words=False)
    lines += [
        "",
        "The schema's metadata has, under `counterfactuals`, a JSON object with the version of the package that made it.",
        "",
    ]
    return "\n".join(lines)


PAGES: Mapping[str, Callable[[], str]] = {
    "manifest.md": manifest_page,
    "stores.md": stores_page,
    "throws.md": throws_page,
    "counterfactuals.md": counterfactuals_page,
}
SLOW_PAGES: Mapping[str, Callable[[], str]] = {"json.md": json_page}


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, page in {**PAGES, **SLOW_PAGES}.items():
        (FOLDER / name).write_text(page())
    sys.exit(0)
