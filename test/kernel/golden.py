"""Calls of everything that the kernel computes, on the same numbers everywhere, and digests of what they leave in memory.

Inputs come out of a hash function as whole numbers; only sums, products, quotients and roots are taken of them, which IEEE
754 rounds alike on every machine. `golden_digests.json` holds what the outputs must be. Where the kernel's mathematics changes
on purpose:

    python -m test.kernel.golden
"""

import ctypes
import hashlib
import json
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.contact.compiled.descent import (
    CompiledAdamW,
    CompiledDescent,
    CompiledLayer,
    CompiledMoments,
    CompiledNetwork,
    Moments,
)
from contact_curation.contact.compiled.evaluation import CompiledModel, CompiledRows
from contact_curation.contact.time_step import CompiledDynamics, CompiledWorld
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled import Kernel, KernelStructure, load_kernel
from contact_curation.solver.compiled_solver import KERNEL_WEIGHTS, ConeBatch

DIGESTS = Path(__file__).with_name("golden_digests.json")

type AnyArray = np.ndarray[Any, np.dtype[Any]]
type Argument = KernelStructure | AnyArray | int

VOID, INT32, INT64 = None, ctypes.c_int, ctypes.c_int64
PERIOD = 1.0 / 148.0
NORMAL, TANGENTS = np.array([0.0, 0.0, 1.0]), 0.18 * np.eye(2, 3)
WEIGHTS = dict(zip(KERNEL_WEIGHTS, (0.1, 1.0, 0.5, 0.25, 1.0, 1e-6), strict=True))
MASS, GRAVITY = 0.37, 187.0
INVERSE_INERTIA = np.array([[3.4, 0.2, -0.1], [0.2, 3.1, 0.3], [-0.1, 0.3, 2.9]])
INERTIA = np.array([[0.296, -0.02, 0.012], [-0.02, 0.327, -0.035], [0.012, -0.035, 0.349]])


@dataclass(frozen=True, eq=False)
class Call:
    """One call, and the memory that it works on.

    Attributes:
        case: its name.
        function: the kernel's.
        result: type of what the function returns.
        arguments: in order; structures and arrays are passed by their addresses, whole numbers as they are.
        arrays: what the structures point to.
    """

    case: str
    function: str
    result: type | None
    arguments: tuple[Argument, ...]
    arrays: tuple[AnyArray, ...] = ()

    def run(self, kernel: Kernel) -> bytes:
        """What the call returns, and all its memory afterwards."""
        kinds = [
            ctypes.c_int64
            if isinstance(one, int)
            else ctypes.c_void_p
            if isinstance(one, np.ndarray)
            else ctypes.POINTER(type(one))
            for one in self.arguments
        ]
        values = [
            one if isinstance(one, int) else one.ctypes.data if isinstance(one, np.ndarray) else ctypes.byref(one)
            for one in self.arguments
        ]
        returned = kernel.function(self.function, self.result, *kinds)(*values) if self.arguments else 0
        return struct.pack("<q", returned or 0) + b"".join(self.memory())

    def blocks(self) -> list[KernelStructure | AnyArray]:
        """Every piece of memory once: structures and arrays of the arguments, then what structures point to."""
        return [*(one for one in self.arguments if not isinstance(one, int)), *self.arrays]

    def memory(self) -> list[bytes]:
        """The blocks' bytes, addresses in them zero."""
        images = [bytearray(one.tobytes() if isinstance(one, np.ndarray) else bytes(one)) for one in self.blocks()]
        for block, offset, _ in self.addresses():
            images[block][offset : offset + 8] = bytes(8)
        return [bytes(image) for image in images]

    def addresses(self) -> list[tuple[int, int, int]]:
        """(block, offset in it, block that it points to) of every address that is not null."""
        blocks = self.blocks()
        starts = {block.ctypes.data: place for place, block in enumerate(blocks) if isinstance(block, np.ndarray)}
        return [
            (place, offset, starts[value])
            for place, block in enumerate(blocks)
            if isinstance(block, KernelStructure)
            for offset, value in _addresses(block, 0)
        ]


def _addresses(value: Any, offset: int) -> Iterator[tuple[int, int]]:
    if isinstance(value, ctypes.Array) and issubclass(value._type_, KernelStructure):
        for place, item in enumerate(value):
            yield from _addresses(item, offset + place * ctypes.sizeof(value._type_))
    elif isinstance(value, KernelStructure):
        for name, kind, *_ in value._fields_:
            own, place = getattr(value, name), offset + getattr(type(value), name).offset
            if kind is not ctypes.c_void_p:
                yield from _addresses(own, place)
            elif own is not None:
                yield place, own


def digests(kernel: Kernel) -> dict[str, str]:
    """SHA-256 of the outputs of every case."""
    return {call.case: hashlib.sha256(call.run(kernel)).hexdigest() for call in golden_calls()}


def replayed(calls: Sequence[Call]) -> bytes:
    """The calls as replay.cpp reads them: numbers of 64 bits, and memory filled up to whole ones."""
    parts = [_numbers(len(calls))]
    for call in calls:
        blocks = call.blocks()
        places = {id(block): place for place, block in enumerate(blocks)}
        memory, addresses = call.memory(), call.addresses()
        arguments = [(0, one) if isinstance(one, int) else (1, places[id(one)]) for one in call.arguments]
        returned = 0 if call.result is None else ctypes.sizeof(call.result)
        parts += [_numbers(len(call.function)), _filled(call.function.encode()), _numbers(returned, len(memory))]
        parts += [part for image in memory for part in (_numbers(len(image)), _filled(image))]
        parts += [_numbers(len(addresses), *(number for address in addresses for number in address))]
        parts += [_numbers(len(arguments), *(number for argument in arguments for number in argument))]
    return b"".join(parts)


def split(output: bytes, calls: Sequence[Call]) -> dict[str, str]:
    """SHA-256 of every case of what replay.cpp wrote."""
    found, begin = {}, 0
    for call in calls:
        end = begin + 8 + sum(map(len, call.memory()))
        found[call.case] = hashlib.sha256(output[begin:end]).hexdigest()
        begin = end
    assert begin == len(output)
    return found


def _numbers(*values: int) -> bytes:
    return struct.pack(f"<{len(values)}q", *values)


def _filled(data: bytes) -> bytes:
    return data + bytes(-len(data) % 8)


def golden_calls() -> list[Call]:
    """All of them, regenerated: calls change their memory."""
    polytopes = [*_solves(), *_evaluations(), *_descents()]
    return [*polytopes, *_network_descents(), *_steps(), *_elementary(), *_bounces(), *_weighted()]


def uniform(name: str, *shape: int, low: float = -1.0, high: float = 1.0) -> Array:
    """Numbers from `low` to `high` that follow from a name."""
    raw = hashlib.shake_256(name.encode()).digest(8 * int(np.prod(shape)))
    share = (np.frombuffer(raw, "<u8") >> np.uint64(11)) * 2.0**-53
    return np.ascontiguousarray((low + (high - low) * share).reshape(shape))


def _states(name: str, count: int, height: float = 1.3) -> Array:
    """(N, 13) near the plane, some vertices of the body in it."""
    states = uniform(name, count, 13)
    states[:, 2] = height + 0.4 * states[:, 2]
    w, x, y, z = states[:, 3:7].T
    states[:, 3:7] /= np.sqrt(w * w + x * x + y * y + z * z)[:, None]
    states[:, 7:] *= 6.0
    return states


def _vertices(count: int) -> Array:
    corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    return np.ascontiguousarray(np.resize(corners, (count, 3)) + uniform(f"vertices {count}", count, 3, low=-0.1, high=0.1))


class _Model:
    """A polytope's numbers and their structure."""

    def __init__(self, contacts: int, circular: bool) -> None:
        self.arrays = (_vertices(contacts), NORMAL + 0.01, 1.1 * _vertices(contacts), TANGENTS + 0.01)
        self.structure = CompiledModel.__new__(CompiledModel)
        for name, value in zip(("vertices_normal", "normal", "vertices_tangent", "tangents"), self.arrays, strict=True):
            setattr(self.structure, name, value.ctypes.data)
        numbers = {"contacts": contacts, "height": -0.02, "mass": MASS, "gravity": GRAVITY, "circular": int(circular)}
        for name, number in (numbers | WEIGHTS).items():
            setattr(self.structure, name, number)
        self.structure.pivot[:] = (0.1, -0.2, 0.05)
        self.structure.inverse_inertia[:] = INVERSE_INERTIA.ravel().tolist()
        self.structure.inertia[:] = INERTIA.ravel().tolist()


class _Rows:
    """Transitions and their structure."""

    def __init__(self, count: int, **outputs: AnyArray) -> None:
        before, after = _states("before", count), _states("after", count, height=1.2)
        after[:, :7] = before[:, :7]
        after[:, 2] -= 0.05
        self.arrays: tuple[AnyArray, ...] = (before, after, np.full(count, PERIOD), *outputs.values())
        addresses = {name: value.ctypes.data for name, value in outputs.items()}
        columns = dict(zip(("before", "after", "dt"), (one.ctypes.data for one in self.arrays), strict=False))
        limits = {"max_iterations": 60, "residual_tolerance": 1e-7, "influence_bound": np.inf, "threads": 2}
        self.structure = CompiledRows(**columns, **addresses, **limits)


def _solves() -> Iterator[Call]:
    for circular in (True, False):
        for contacts in (1, 5, 8, 32):
            yield _solve(circular, contacts, 13)
        yield _solve(circular, 8, 600, threads=3)
        yield _solve(circular, 8, 13, max_iterations=3)
        yield _solve(circular, 6, 11, spoilt=(("jacobians", np.nan), ("gaps", np.inf), ("dt", -np.inf)))


def _solve(
    circular: bool,
    contacts: int,
    batch: int,
    threads: int = 1,
    max_iterations: int = 60,
    spoilt: Sequence[tuple[str, float]] = (),
) -> Call:
    case = f"solve {'circular' if circular else 'polyhedral'} {contacts} {batch} {max_iterations} {len(spoilt)}"
    inverse_mass = np.zeros((6, 6))
    inverse_mass[:3, :3] = np.eye(3) / MASS
    inverse_mass[3:, 3:] = INVERSE_INERTIA
    given: dict[str, AnyArray] = {
        "jacobians": uniform(case + "J", batch, contacts, 3, 6),
        "inverse_mass": inverse_mass,
        "gaps": uniform(case + "gaps", batch, contacts, low=-0.02, high=0.3),
        "gaps_next": uniform(case + "next", batch, contacts, low=-0.02, high=0.3),
        "free_velocities": uniform(case + "free", batch, 6, low=-5.0, high=5.0),
        "velocities_next": uniform(case + "velocities", batch, 6, low=-5.0, high=5.0),
        "dt": np.full(batch, PERIOD),
    }
    for place, (name, value) in enumerate(spoilt):
        given[name].reshape(batch, -1)[3 * place + 1, 0] = value
    found: dict[str, AnyArray] = {
        "impulses": np.zeros((batch, contacts, 3)),
        "residuals": np.zeros(batch),
        "status": np.zeros(batch, np.int32),
        "iterations": np.zeros(batch, np.int32),
    }
    addresses = {name: value.ctypes.data for name, value in (given | found).items()}
    limits = {"threads": threads, "max_iterations": max_iterations, "residual_tolerance": 1e-7}
    job = ConeBatch(batch=batch, contacts=contacts, circular=int(circular), **limits, **WEIGHTS, **addresses)
    return Call(case, "contact_curation_solve_cones", INT32, (job,), (*given.values(), *found.values()))


def _evaluations() -> Iterator[Call]:
    for circular in (True, False):
        for estimator, contacts in ((0, 4), (1, 8), (2, 8), (2, 11), (2, 32)):
            yield _evaluation(circular, estimator, contacts)
        yield _evaluation(circular, 2, 8, bound=0.3)
        yield _evaluation(circular, 1, 8, spoilt=True)


def _evaluation(
    circular: bool,
    estimator: int,
    contacts: int,
    bound: float = np.inf,
    spoilt: bool = False,
    restitution: Array | None = None,
    weights: Array | None = None,
) -> Call:
    case = f"evaluate {'circular' if circular else 'polyhedral'} {estimator} {contacts} {bound} {spoilt}"
    count, size, starts = 30, 6 * contacts + 10 + (restitution is not None), np.array([0, 9, 10, 10, 30])
    outputs: dict[str, AnyArray] = {
        "terms": np.zeros((count, 5)),
        "impulse": np.zeros((count, contacts, 3)),
        "score": np.zeros((count, size)),
        "residual": np.zeros(count),
        "status": np.zeros(count, np.int32),
        "iterations": np.zeros(count, np.int32),
        "score_sum": np.zeros((4, size)),
    }
    if estimator:
        outputs["fisher"] = np.zeros((4, size, size))
    model, rows = _Model(contacts, circular), _Rows(count, starts=starts, **outputs)
    rows.structure.tosses, rows.structure.estimator, rows.structure.influence_bound = 4, estimator, bound
    if spoilt:
        rows.arrays[0][4, 8], rows.arrays[1][12, 9] = np.nan, np.inf
    arguments, arrays = (model.structure, rows.structure), (*model.arrays, *rows.arrays)
    if weights is not None and restitution is not None:
        given = (*arguments, weights, restitution)
        return Call(f"weighted {case}", "contact_curation_evaluate_weighted", INT32, given, arrays)
    if restitution is not None:
        return Call(f"bouncing {case}", "contact_curation_evaluate_bouncing", INT32, (*arguments, restitution), arrays)
    return Call(case, "contact_curation_evaluate", INT32, arguments, arrays)


def _weighted() -> Iterator[Call]:
    weights = uniform("weights", 10, low=0.1, high=1.0)[np.arange(30) // 3]  # equal in runs, some of which end amid a toss
    for circular in (True, False):
        for estimator in (1, 2):
            yield _evaluation(circular, estimator, 8, restitution=np.array([0.4]), weights=weights)


def _moments(name: str, *shape: int, theta: AnyArray | None = None) -> Moments:
    values = uniform(name, *shape, low=-0.4, high=0.4) if theta is None else theta
    return Moments(values, np.zeros(shape), np.zeros(shape))


def _arrays(moments: Sequence[Moments]) -> tuple[AnyArray, ...]:
    return tuple(array for one in moments for array in (one.theta, one.first, one.second))


class _Job:
    """Gradient steps and their structure."""

    def __init__(self, steps: int, rows: int) -> None:
        order = (uniform("order", steps, low=0.0, high=float(rows))).astype(np.int64)
        self.arrays: tuple[AnyArray, ...] = (order, uniform("shares", steps, low=0.5, high=1.0))
        self.structure = CompiledDescent(
            rows=order.ctypes.data, shares=self.arrays[1].ctypes.data, steps=steps, regularizer=0.3,
            polytope=CompiledAdamW(1e-3, 0.1), network=CompiledAdamW(2e-3, 0.2),
            first_beta=0.9, second_beta=0.999, epsilon=1e-8, share=0.25, seen=17.0, loss_sum=0.125,
        )  # fmt: skip

    def take_polytope(self, model: _Model) -> None:
        moments = [_moments("", *theta.shape, theta=theta) for theta in model.arrays]
        for place, one in enumerate(moments):
            self.structure.theta[place] = CompiledMoments.of(one)
        self.arrays += tuple(array for one in moments for array in (one.first, one.second))

    def take_network(self, place: int, name: str, sizes: Sequence[int], rectified: bool) -> None:
        network = CompiledNetwork(len(sizes) - 1, int(rectified))
        for depth, (inputs, outputs) in enumerate(pairwise(sizes)):
            weight, bias = _moments(f"{name} {depth}", outputs, inputs), _moments(f"{name} {depth} bias", outputs)
            network.layer[depth] = CompiledLayer(inputs, outputs, CompiledMoments.of(weight), CompiledMoments.of(bias))
            self.arrays += _arrays([weight, bias])
        self.structure.networks[place] = network

    def take_scaling(self, inputs: int) -> None:
        mean, scale = uniform("mean", inputs), uniform("scale", inputs, low=0.3, high=1.5)
        self.structure.mean, self.structure.scale = mean.ctypes.data, scale.ctypes.data
        self.arrays += (mean, scale)


def _descents() -> Iterator[Call]:
    for circular in (True, False):
        model, rows, job = _Model(8, circular), _Rows(30), _Job(25, 30)
        job.take_polytope(model)
        arguments = model.structure, rows.structure, job.structure
        arrays = *model.arrays, *rows.arrays, *job.arrays
        yield Call(f"descend {'circular' if circular else 'polyhedral'}", "contact_curation_descend", INT64, arguments, arrays)


def _network_descents() -> Iterator[Call]:
    for rectified in (False, True):
        for kind in ("deep", "deepvertex", "end_to_end"):
            model, rows, job = _Model(6, rectified), _Rows(30), _Job(25, 30)
            if kind == "deep":
                job.take_polytope(model)
                job.take_network(0, "gaps", (12, 21, 13, 6), rectified)
                job.take_network(1, "tangents", (12, 16, 12), rectified)
            elif kind == "deepvertex":
                job.take_network(0, "vertices", (9, 21, 13, 18), rectified)
                job.take_scaling(9)
            else:
                job.take_network(0, "impulse", (24, 37, 16, 6), rectified)
                job.take_scaling(24)
                job.structure.squared = int(rectified)
            arguments = model.structure, rows.structure, job.structure
            arrays = *model.arrays, *rows.arrays, *job.arrays
            yield Call(f"descend {kind} {rectified}", f"contact_curation_descend_{kind}", INT64, arguments, arrays)


def _dynamics() -> tuple[CompiledDynamics, tuple[AnyArray, AnyArray]]:
    inverse_inertia, inertia = INVERSE_INERTIA.copy(), INERTIA.copy()
    dynamics = CompiledDynamics.__new__(CompiledDynamics)
    dynamics.inverse_inertia, dynamics.inverse_mass, dynamics.gravity = inverse_inertia.ctypes.data, 1.0 / MASS, GRAVITY
    dynamics.inertia = inertia.ctypes.data
    dynamics.tolerance, dynamics.max_sweeps = 1e-6, 400
    return dynamics, (inverse_inertia, inertia)


def _world(contacts: int) -> tuple[CompiledWorld, tuple[AnyArray, ...]]:
    dynamics, inertias = _dynamics()
    arrays = (_vertices(contacts), NORMAL.copy(), 1.1 * _vertices(contacts), TANGENTS.copy(), np.array([0.1, -0.2, 0.05]))
    world = CompiledWorld.__new__(CompiledWorld)
    names = ("vertices_normal", "normal", "vertices_tangent", "tangents", "pivot")
    for name, value in zip(names, arrays, strict=True):
        setattr(world, name, value.ctypes.data)
    world.vertices, world.height, world.dynamics = contacts, -0.02, dynamics
    return world, (*arrays, *inertias)


def _steps() -> Iterator[Call]:
    count, contacts = 40, 8
    states, periods = _states("steps", count), uniform("periods", count, low=0.004, high=0.01)
    states[::5, 10:] *= 1e3  # whole turns within a step
    states[7, 9], states[11, 12] = np.nan, 1e308
    world, arrays = _world(contacts)
    outputs: tuple[AnyArray, ...] = (np.zeros((count, contacts, 3)), np.zeros(count, np.int32), np.zeros(count))
    yield Call("time step", "contact_time_step", VOID, (world, count, periods, states.copy(), *outputs), arrays)

    dynamics, inertias = _dynamics()
    gaps, jacobians = uniform("given gaps", count, 5, low=-0.02, high=0.2), uniform("given rows", count, 5, 3, 6)
    gaps[3, 2] = np.inf
    outputs = (uniform("guess", count, 5, 3, low=0.0, high=0.1), np.zeros(count, np.int32), np.zeros(count))
    arguments = dynamics, count, 5, periods, gaps, jacobians, states.copy(), *outputs
    yield Call("given step", "contact_given_step", VOID, arguments, inertias)

    for threads in (1, 3):
        lengths = np.array([60, 1, 90, 2, 40, 3, 60])
        offsets, first = np.concatenate([[0], np.cumsum(lengths)]), _states("rollouts", 7, height=2.0)
        first[5, 8] = np.inf
        rows = int(offsets[-1])
        world, arrays = _world(contacts)
        outputs = (np.zeros((rows, 13)), np.zeros((rows, contacts, 3)), np.zeros(rows, np.int32), np.zeros(rows))
        whole = (world, 7, first, offsets, periods[:7].copy(), threads, *outputs)
        yield Call(f"rollout {threads}", "contact_rollout", VOID, whole, arrays)


def _elementary() -> Iterator[Call]:
    special = np.array([0.0, -0.0, 1e-310, 1e-20, 20.0, 1e4, 1e5, 1e17, 1e300, np.inf, np.nan, 2.0**-1074])
    spread = [uniform(f"elementary {size}", 400, low=-size, high=size) for size in (1e-3, 0.5, 2.0, 30.0, 1e4, 1e6)]
    x = np.concatenate([special, -special, *spread])
    results = [np.zeros(len(x)) for _ in range(3)]
    yield Call("elementary", "contact_curation_elementary", VOID, (len(x), x, *results))
    exponents = (uniform("exponents", 400, low=0.0, high=1.0) ** 8 * 1e6).astype(np.int64)
    bases = np.concatenate([np.full(100, 0.9), np.full(100, 0.999), uniform("bases", 200, low=0.0, high=1.0)])
    yield Call("powers", "contact_curation_powers", VOID, (400, bases, exponents, np.zeros(400)))


def _bounces() -> Iterator[Call]:
    restitution, contacts, count = np.array([0.4]), 8, 40
    for circular in (True, False):
        for estimator in (1, 2):
            yield _evaluation(circular, estimator, contacts, restitution=restitution)
    states, world, arrays = _states("bounces", count), *_world(contacts)
    outputs: tuple[AnyArray, ...] = (np.zeros((count, contacts, 3)), np.zeros(count, np.int32), np.zeros(count))
    arguments: tuple[Argument, ...] = world, restitution, count, np.full(count, PERIOD), states, *outputs
    yield Call("bouncing step", "contact_time_step_bouncing", VOID, arguments, arrays)
    world, arrays = _world(contacts)
    outputs = (np.zeros((120, 13)), np.zeros((120, contacts, 3)), np.zeros(120, np.int32), np.zeros(120))
    given = _states("bouncing rollouts", 2, height=2.0), np.array([0, 70, 120]), np.full(2, PERIOD)
    whole: tuple[Argument, ...] = (world, restitution, 2, *given, 2, *outputs)
    yield Call("bouncing rollout", "contact_rollout_bouncing", VOID, whole, arrays)


if __name__ == "__main__":
    found = {"inputs": hashlib.sha256(replayed(golden_calls())).hexdigest(), "outputs": digests(load_kernel())}
    DIGESTS.write_text(json.dumps(found, indent=2) + "\n")
