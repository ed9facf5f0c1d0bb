"""Writes the data card of an export (README.md): what the tosses are, where they come from and how they were selected.

Data cards follow Pushkarna et al., "Data Cards" (FAccT 2022), shortened to the content of the manifest. Hosts of datasets read
the front matter. Licence and contact are left for the user to fill in.
"""

import shlex
from collections import Counter
from collections.abc import Iterator

from contact_curation.contact.body import Body
from contact_curation.storage.manifest.manifest import Manifest, ManifestRow
from contact_curation.version import __version__

CARD = "README.md"
"""Name of the file, which hosts of datasets show."""

TAGS = "robotics, contact, toss, contact-curation"
FRONT = {
    "lerobot": (
        f"tags: [{TAGS}, LeRobot]",
        "task_categories: [robotics]",
        'configs: [{config_name: default, data_files: "data/*/*.parquet"}]',
    )
}
"""Front matter of a format; without `configs` Hugging Face's `datasets` takes the tables of `meta/` for frames, and fails."""

LAYOUTS = {
    "mcap": "MCAP recordings with the recorded messages of the selected tosses; `manifest.json` has a row per toss.",
    "contactnets": "ContactNets' files: `tosses_processed/0.pt` is the best toss; row N of `manifest.json` describes N.pt.",
    "lerobot": "A LeRobot dataset v3.0 with an episode per toss, best first; the manifest is `meta/curation.json`.",
}
"""Content of an export, by its format."""

FILL_IN = "TO BE FILLED IN by whoever publishes this folder"


def data_card(form: str, body: Body, manifest: Manifest) -> str:
    """Makes the card as Markdown.

    Args:
        form: format of the export, one of `LAYOUTS`.
        body: tossed body.
        manifest: manifest of the whole ranking, of which the selected tosses are exported.
    """
    return "\n".join(_lines(form, body, manifest)) + "\n"


def _lines(form: str, body: Body, manifest: Manifest) -> Iterator[str]:
    run, selected = manifest.run, manifest.selected
    yield from ("---", "license: unknown  # " + FILL_IN, *FRONT.get(form, (f"tags: [{TAGS}]",)), "---", "")
    yield from (f"# Tosses of {body.name}", "", LAYOUTS[form], "")
    seconds, frames = sum(row.duration for row in selected), sum(row.frames for row in selected)
    yield from ("| | |", "|---|---|")
    yield f"| tosses | {len(selected)}, {seconds:.1f} s, {frames} poses |"
    yield f"| body | {body.name}: {len(body.vertices)} vertices, {body.mass:g} kg, length scale {body.length_scale:g} m |"
    yield f"| selected by | criterion {run.criterion}, estimator {run.estimator or 'none'}, seed {run.seed} |"
    yield f"| at the parameters | {run.model}, {run.parameters} (version {run.parameters_version}) |"
    yield f"| ranked with | contact_curation {run.package_version}; exported with {__version__} |"
    if run.settings:
        yield f"| settings | `{_cell(' '.join(run.settings))}` |"
    yield f"| command | `{_cell(shlex.join(run.command))}` |" if run.command else "| command | none: ranked from Python |"
    yield from (f"| license | {FILL_IN} |", f"| contact | {FILL_IN} |", "")
    yield from ("## Source recordings", "", "| file | SHA-256 | tosses |", "|---|---|---|")
    exported = Counter(map(manifest.given_input, selected))
    for one in run.inputs:
        digest = f"`{one.sha256}`" if one.sha256 else "not read"
        yield f"| {_cell(one.path)} | {digest} | {exported[one.path]} |"
    yield from ("", "## What was left out", "")
    left_out = Counter(_why(row) for row in manifest.rows if not row.selected)
    yield f"{len(manifest.rows)} tosses were found and {len(selected)} were selected.{' The others:' if left_out else ''}"
    yield from ("", "| tosses | why |", "|---|---|") if left_out else ()
    yield from (f"| {count} | {why} |" for why, count in left_out.most_common())
    yield from ("", "A selection is no random sample: rates and averages of these tosses are not those of the recordings.")


def _why(row: ManifestRow) -> str:
    return "not selected by the ranking" if row.rank is not None else f"not ranked: {_cell(row.reasons[0].partition(':')[0])}"


def _cell(text: str) -> str:
    """Text in a cell of a table, which a vertical line would end."""
    return text.replace("|", "\\|")
