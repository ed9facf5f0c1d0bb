"""What the tests of the command line share: outcomes of commands, and parameter files."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry

ASSUMES_THE_CUBE = "contact-curation: no --body given: assuming ContactNets' cube (0.37 kg, 105 mm)"
"""On standard error, once a verb that was given no body is done."""


class Outcome(NamedTuple):
    """What a command did: exit status, standard output, standard error."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)

    @property
    def err_lines(self) -> list[str]:
        return self.err.splitlines()


Cli = Callable[..., Outcome]


def write_parameters(path: Path, **changes: Any) -> Path:
    """A --params file of the true cube, with changes."""
    true = ContactGeometry.of_body(CONTACTNETS_CUBE)
    plain = {name: getattr(true, name).tolist() for name in ("vertices_normal", "normal", "vertices_tangent", "tangents")}
    path.write_text(json.dumps({**plain, **changes}))
    return path
