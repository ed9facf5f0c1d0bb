"""One rigid link of a robot description, as it was found."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from contact_curation.errors import UnreadableInputError
from contact_curation.geometry.solids.mass_properties import MassProperties
from contact_curation.geometry.solids.shapes import Solid


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid body in the frame of its file.

    Attributes:
        name: name of the link, the robot or the file.
        solid: what collides, as one body of density 1 kg/m^3.
        mass: its mass properties as the file says them; None where it does not.
        friction: Coulomb coefficient; None where the file says none.
        notes: what was assumed, one line each.
    """

    name: str
    solid: Solid
    mass: MassProperties | None = None
    friction: float | None = None
    notes: tuple[str, ...] = ()


def chosen_name(path: Path, names: Sequence[str], wanted: str | None, expected: str) -> str:
    """The link to take.

    Args:
        path: path of the file, for the message.
        names: names of the links that have collision geometry.
        wanted: the name that was asked for; None for the only one.
        expected: what there was none of, for the message.

    Raises:
        UnreadableInputError: there is none, or several, or none of that name.
    """
    if not names:
        raise UnreadableInputError(path, f"found no {expected}")
    listed = _listed(names)
    if wanted is None and len(names) > 1:
        raise UnreadableInputError(
            path, f"found {len(names)} links with collision geometry ({listed}), expected one: choose with --link NAME"
        )
    if wanted is not None and wanted not in names:
        raise UnreadableInputError(path, f"--link: found no link {wanted} with collision geometry, expected one of {listed}")
    return wanted or names[0]


def not_counted(name: str, others: Sequence[str]) -> tuple[str, ...]:
    """A note of what is fixed to the link that was taken.

    Args:
        name: of the link.
        others: names of the links with a mass that are fixed to it.
    """
    if not others:
        return ()
    return (f"{_listed(others)}: fixed to {name}, but not counted: shape, mass and inertia are those of {name} alone",)


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
