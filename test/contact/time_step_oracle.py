"""One time step of method.md 4.2 in plain loops, and what its answer must satisfy; slow, and written to be read."""

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array


def contact_rows(geometry: ContactGeometry, state: Array) -> tuple[Array, Array]:
    """Rows J (V, 3, 6) as [J_n, J_t1, J_t2], and gaps (V,)."""
    rotation = quaternions.to_matrix(state[3:7])
    rows = np.empty((geometry.vertex_count, 3, 6))
    gaps = np.empty(geometry.vertex_count)
    for i in range(geometry.vertex_count):
        p, p_t = geometry.vertices_normal[i], geometry.vertices_tangent[i]
        rows[i, 0] = [*geometry.normal, *np.cross(p, rotation.T @ geometry.normal)]
        for a in range(2):
            rows[i, 1 + a] = [*geometry.tangents[a], *np.cross(p_t, rotation.T @ geometry.tangents[a])]
        gaps[i] = geometry.normal @ (rotation @ p + state[:3] - geometry.pivot) - geometry.height
    return rows, gaps


def mass_matrix(body: Body) -> Array:
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = body.mass * np.eye(3)
    matrix[3:, 3:] = body.scaled_inertia
    return matrix


def energies(body: Body, states: Array) -> Array:
    """Kinetic and potential energy (N,) of states (N, 13)."""
    twists = states[:, 7:]
    kinetic = 0.5 * np.einsum("nj,jk,nk->n", twists, mass_matrix(body), twists)
    return np.asarray(kinetic + body.mass * body.scaled_gravity * states[:, 2])


def falling_twist(body: Body, state: Array, dt: float) -> Array:
    """v_f = v - g dt e3."""
    twist = state[7:].copy()
    twist[2] -= body.scaled_gravity * dt
    return twist


def oracle_step(geometry: ContactGeometry, body: Body, state: Array, dt: float, sweeps: int = 5000) -> tuple[Array, Array]:
    """The state after dt of a polytope and the impulses (V, 3)."""
    return oracle_step_at(*contact_rows(geometry, state), body, state, dt, sweeps)


def oracle_step_at(rows: Array, gaps: Array, body: Body, state: Array, dt: float, sweeps: int = 5000) -> tuple[Array, Array]:
    """The state after dt at contacts (K, 3, 6) and (K,), and the impulses (K, 3), by gradient steps on one after the other."""
    inverse_mass = np.linalg.inv(mass_matrix(body))
    twist = falling_twist(body, state, dt)
    impulses = np.zeros((len(gaps), 3))
    for _ in range(sweeps):
        before = impulses.copy()
        for i, (row, gap) in enumerate(zip(rows, gaps, strict=True)):
            mobility = row @ inverse_mass @ row.T
            wanted = impulses[i].copy()
            wanted[0] = max(0.0, wanted[0] - (row[0] @ twist + gap / dt) / mobility[0, 0])
            twist = twist + inverse_mass @ row.T @ (wanted - impulses[i])
            impulses[i] = wanted
            steepest = np.linalg.eigvalsh(mobility[1:, 1:]).max()
            if steepest > 0.0:
                wanted = np.array([wanted[0], *_into_disk(wanted[1:] - row[1:] @ twist / steepest, wanted[0])])
            twist = twist + inverse_mass @ row.T @ (wanted - impulses[i])
            impulses[i] = wanted
        if np.abs(impulses - before).max() < 1e-13:
            break
    return moved(state, twist, dt), impulses


def moved(state: Array, twist: Array, dt: float) -> Array:
    """The state that moves with a twist for dt."""
    position = state[:3] + dt * twist[:3]
    orientation = quaternions.multiply(state[3:7], quaternions.exp(dt * twist[3:]))
    return np.concatenate([position, orientation, twist])


def violation(geometry: ContactGeometry, body: Body, state: Array, dt: float, after: Array, impulses: Array) -> float:
    """How far a step is from solving the complementarity problem, as a speed; 0 at a solution."""
    rows, gaps = contact_rows(geometry, state)
    inverse_mass = np.linalg.inv(mass_matrix(body))
    response = inverse_mass @ np.einsum("iak,ia->k", rows, impulses)
    worst = float(np.abs(after[7:] - falling_twist(body, state, dt) - response).max())
    for row, gap, impulse in zip(rows, gaps, impulses, strict=True):
        mobility = row @ inverse_mass @ row.T
        closing = row[0] @ after[7:] + gap / dt
        worst = max(worst, abs(min(closing, mobility[0, 0] * impulse[0])))
        steepest = np.linalg.eigvalsh(mobility[1:, 1:]).max()
        if steepest > 0.0:
            moved = _into_disk(impulse[1:] - row[1:] @ after[7:] / steepest, impulse[0])
            worst = max(worst, float(np.linalg.norm(moved - impulse[1:])) * steepest)
    return worst


def _into_disk(vector: Array, radius: float) -> Array:
    length = float(np.linalg.norm(vector))
    return vector if length <= radius else vector * (radius / length)
