"""Random throws by the simulated arm: how accurately, within which limits, how fast, and what is refused.

    python -m benchmarks.design.arm_throws [--throws 200] [--seed 0] [--heedless]

Prints percentiles of the release errors over feasible throws, the largest shares of the limits that were used, and that every
throw beyond a limit was refused. With --heedless throws are planned without a look at where the body bounces, to see what
happens when it meets the arm.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.design.releases import PUBLISHED_PRIOR, Placement
from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.simulation.arm.departure import DEFAULT_DEPARTURE, DepartureConfig
from contact_curation.simulation.arm.feasibility import ArmFeasibility
from contact_curation.simulation.arm.safety import GateConfig
from contact_curation.simulation.arm.throw import ArmThrower, ExecutedThrow, ReleaseErrors
from contact_curation.simulation.arm.throw_motion import FRAME_PERIOD, ThrowMotion, ThrowPlanner

HEEDLESS = DepartureConfig(at_first=-1.0, opening=0.0)
PERCENTILES = (50, 95, 100)
LINES: tuple[tuple[str, str, float, Callable[[ReleaseErrors], float]], ...] = (
    ("speed", "%", 100.0, lambda errors: errors.speed),
    ("direction", "deg", 180.0 / np.pi, lambda errors: errors.direction),
    ("spin", "rad/s", 1.0, lambda errors: errors.spin),
    ("position", "mm", 1e3, lambda errors: errors.position),
    ("orientation", "deg", 180.0 / np.pi, lambda errors: errors.turn),
)


def published_throws(count: int, seed: int) -> list[Throw]:
    """Throws like those of ContactNets, all from where the thrower stands by default."""
    states = PUBLISHED_PRIOR.draw(count, np.random.default_rng(seed)).states(Placement())
    return [throw_of_state(f"throw{k}", "cube", state) for k, state in enumerate(states)]


def impossible_throws(throws: list[Throw]) -> list[Throw]:
    """Each of them beyond something: too fast, spinning too fast, too far away, too low, or into the table."""
    x, z = np.eye(3)[0], np.eye(3)[2]
    changes = (
        lambda throw: {"linear_velocity": 50.0 * x},
        lambda throw: {"linear_velocity": 2.5 * throw.linear_velocity},
        lambda throw: {"angular_velocity": 30.0 * throw.angular_velocity / np.linalg.norm(throw.angular_velocity)},
        lambda throw: {"position": throw.position + 1.5 * x},
        lambda throw: {"position": throw.position + 0.8 * z},
        lambda throw: {"position": throw.position * [1.0, 1.0, 0.0] + 0.03 * z},
    )
    return [replace(throw, **changes[k % len(changes)](throw)) for k, throw in enumerate(throws)]


def report_errors(made: list[ExecutedThrow]) -> None:
    """Percentiles of each kind of error."""
    print(f"{'error of the release':22}" + "".join(f"{p:>9d} %" for p in PERCENTILES))
    for name, unit, scale, value in LINES:
        values = scale * np.array([value(one.errors) for one in made])
        print(f"{name + ' [' + unit + ']':22}" + "".join(f"{np.percentile(values, p):11.3f}" for p in PERCENTILES))


def main() -> None:
    """Runs it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--throws", type=int, default=200, help="feasible throws to make")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--heedless", action="store_true", help="plan without a look at where the thrown body bounces")
    arguments = parser.parse_args()

    began = time.perf_counter()
    planner = ThrowPlanner(CONTACTNETS_CUBE, departure=HEEDLESS if arguments.heedless else DEFAULT_DEPARTURE)
    print(f"planner ready after {time.perf_counter() - began:.1f} s")
    feasibility, thrower = ArmFeasibility(planner, GateConfig()), ArmThrower(planner)
    motions: list[ThrowMotion] = []
    asked, planning = 0, 0.0
    for throw in published_throws(3 * arguments.throws, arguments.seed):
        began = time.perf_counter()
        motion = feasibility.motion(throw)
        planning, asked = planning + time.perf_counter() - began, asked + 1
        if isinstance(motion, ThrowMotion):
            motions.append(motion)
        if len(motions) == arguments.throws:
            break
    print(f"{len(motions)} of {asked} random throws are feasible; {1e3 * planning / asked:.0f} ms to tell and plan one")

    simulated, began, working = 0.0, time.perf_counter(), time.process_time()
    made = []
    for motion in motions:
        before = thrower.time
        made.append(thrower.carry_out(motion))
        simulated += thrower.time - before
    elapsed, worked = time.perf_counter() - began, time.process_time() - working
    report_errors(made)
    for name in ("torque", "speed", "position"):
        used = [float(getattr(one.peaks, name).max()) for one in made]
        most = int(np.argmax(used))
        print(f"largest share of a {name} limit: {used[most]:.3f} ({made[most].throw.throw_id})")
    rested, touched, gave_way = (sum(getattr(one, name) for one in made) for name in ("rested", "touched", "gave_way"))
    print(f"came to rest: {rested} of {len(made)}; touched the arm: {touched}; the arm gave way: {gave_way}")
    frames = sum(len(one.states) for one in made)
    flight, ratio, own = frames * FRAME_PERIOD, simulated / elapsed, simulated / worked
    print(f"simulated {simulated:.0f} s ({flight:.0f} s of flight) in {elapsed:.1f} s: {ratio:.1f} times real time")
    print(f"{worked:.1f} s of a processor's time: {own:.1f} times real time on an idle machine")

    beyond = impossible_throws([motion.throw for motion in motions])
    refused = sum(answer is not None for answer in feasibility(beyond))
    print(f"refused {refused} of {len(beyond)} throws beyond a limit")
    slow = [replace(motion.throw, throw_id="slower") for motion in motions[:20]]
    began = time.perf_counter()
    nearest = [feasibility.nearest(throw) for throw in impossible_throws(slow)]
    found = [one for one in nearest if one is not None and feasibility.refusal(one) is None]
    print(
        f"nearest feasible throws: {len(found)} of {len(slow)}, {1e3 * (time.perf_counter() - began) / len(slow):.0f} ms each"
    )


if __name__ == "__main__":
    main()
