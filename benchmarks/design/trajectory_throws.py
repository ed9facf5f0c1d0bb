"""Designed throws by two arms known by their description alone, behind controllers that share no code with the package.

    python -m benchmarks.design.trajectory_throws [--throws 50] [--seed 0] [--arm ur5e] [--uneven 0.004]

The stage that `trajectory_thrower` runs throws a cube in simulated time (test/foreign_arm/cell.py). The arm is 20 ms late and
strays by 1 % of its way, the gripper opens 50 +- 10 ms after its command, and a tracker sees the cube. Throws are designed for
the published cube, from releases at 0.6 times the published speeds and 0.3 times the published spins, and each arm refuses
those that it cannot make. Then every fault happens at four moments of a throw. The thrower learns that joints go 1 % too far;
with `--uneven` the last joint is so much later than the first [s], too, which it does not correct.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.designer import ONE_THREAD
from contact_curation.design.greedy_batch import RefinementConfig
from contact_curation.design.planner import DesignConfig, Planner
from contact_curation.design.predicted_information import Particle
from contact_curation.design.releases import PriorConfig, published_prior
from contact_curation.design.throw import Throw
from contact_curation.simulation.arm.safety import path_out_of_limits
from contact_curation.simulation.arm.throw_motion import Refused
from test.foreign_arm.arms import FILES
from test.foreign_arm.throwing import FAULTS, Lab

SLOWER = PriorConfig(speed=0.6, spin=0.3)
"""Than the published throws."""

FEWEST = 6
"""Throws: the first few show the gripper's delay."""

SHORTLY = 0.1
"""Time after the release [s]."""


def before(lab: Lab, time: float) -> bool:
    """Whether the gripper is told to open in so many seconds."""
    due = lab.stage.opens_at
    return due is not None and lab.cell.time >= due - time


def shortly_after(lab: Lab) -> bool:
    """Whether the cube was let go a moment ago."""
    return lab.stage.released and lab.cell.grip is None and lab.cell.time >= lab.cell.released[-1][0] + SHORTLY


MOMENTS: dict[str, Callable[[Lab], bool]] = {
    "before the goal": lambda lab: not lab.stage.busy,
    "0.3 s before the command to open": lambda lab: before(lab, 0.3),
    "0.05 s before it": lambda lab: before(lab, 0.05),
    "0.1 s after the release": shortly_after,
}
"""When a fault happens."""


def designed(lab: Lab, count: int, seed: int) -> tuple[Throw, ...]:
    """The most informative throws of a pool that the arm can make."""

    def refusals(throws: Sequence[Throw]) -> list[str | None]:
        answers = [lab.planner.plan(throw) for throw in throws]
        return [str(answer) if isinstance(answer, Refused) else None for answer in answers]

    particle = Particle(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, ONE_THREAD)
    config = DesignConfig(pool=2 * count, refinement=RefinementConfig(generations=0))
    planner = Planner([particle], published_prior(SLOWER), config=config, feasible=refusals)
    return planner.plan([f"throw-{number}" for number in range(count)], planner.known(), seed).throws


def percentiles(errors: list[float]) -> str:
    """Of their sizes."""
    sizes = np.abs(errors)
    return f"median {np.median(sizes):.2f}, 90 % {np.percentile(sizes, 90.0):.2f}, largest {sizes.max():.2f}"


def report_throws(lab: Lab, throws: tuple[Throw, ...]) -> None:
    """Makes throws, and prints how well."""
    speeds, velocities, told, moments, used = list[float](), list[float](), list[float](), list[float](), Counter[str]()
    for throw in throws:
        ending = lab.throw(throw)
        if not ending.success or ending.executed is None:
            print(f"    {throw.throw_id}: {ending.message}")
            continue
        when, _, twist = lab.cell.released[-1]
        speed = float(np.linalg.norm(twist[:3]))
        wanted = float(np.linalg.norm(throw.linear_velocity))
        speeds.append(100.0 * (speed / wanted - 1.0))
        velocities.append(100.0 * float(np.linalg.norm(twist[:3] - throw.linear_velocity)) / wanted)
        told.append(100.0 * (float(np.linalg.norm(ending.executed.linear_velocity)) / speed - 1.0))
        moments.append(1e3 * (ending.released_at - when))
        used |= Counter(lab.used())  # the larger of the two
        lab.rest()
    delay, drawn = lab.stage.delay, 1e3 * np.array(lab.cell.delays)
    print(f"    throws made: {len(speeds)} of {len(throws)}")
    print(f"    gripper's delay [ms]: learned {1e3 * delay.mean:.1f}, drawn {drawn.mean():.1f} on average, "
          f"set {1e3 * lab.cell.delay:.0f}; jitter: learned {1e3 * delay.jitter:.1f}, drawn {drawn.std():.1f}")  # fmt: skip
    print(f"    release speed against the goal's [%]: {percentiles(speeds)}; within 2 %: {sum(np.abs(speeds) <= 2.0)}; "
          f"first {speeds[0]:.2f}, largest after it {np.abs(speeds[1:]).max():.2f}")  # fmt: skip
    print(f"    size of the velocity's error against the goal's speed [%]: {percentiles(velocities)}; "
          f"of the first throw {velocities[0]:.2f}")  # fmt: skip
    print(f"    release as told against the true one: speed [%] {percentiles(told)}; moment [ms] {percentiles(moments)}")
    print("    largest share of a limit: " + ", ".join(f"{name} {share:.3f}" for name, share in used.items()))


def report_faults(lab: Lab, throw: Throw) -> None:
    """Lets every fault happen at every moment, and prints what became of the throws."""
    safe, by_hand, outcomes = 0, 0, Counter[str]()
    for name, (happens, line) in FAULTS.items():
        for when, is_now in MOMENTS.items():
            outcome, against = faulty(lab, throw, happens, is_now)
            wrong = against or ("" if line in outcome else f"it does not say {line!r}")
            if wrong:
                print(f"    {name}, {when}: {wrong}: {outcome}")
            safe += not wrong
            outcomes[outcome.partition(":")[0] if lab.sent else "refused"] += 1
            by_hand += recover(lab)
    print(f"    faults refused or ended safely: {safe} of {outcomes.total()}; "
          + ", ".join(f"{outcome} {number}" for outcome, number in outcomes.items()) + f"; home by hand {by_hand}")  # fmt: skip


def faulty(lab: Lab, throw: Throw, happens: Callable[[Lab], None], is_now: Callable[[Lab], bool]) -> tuple[str, str]:
    """Makes a throw with a fault: its message, and in one line what was not safe; empty if all was."""

    def meanwhile() -> None:
        if is_now(lab):
            happens(lab)

    meanwhile()
    lab.rest(1.0)
    opened, lab.meanwhile = len(lab.cell.delays), meanwhile
    ending = lab.throw(throw)
    lab.rest()
    limits, used = lab.planner.arm.limits, lab.used()
    beyond = [line for line in (path_out_of_limits(sent.path, limits) for sent in lab.sent) if line]
    wrong = {
        "the throw counts as made": ending.success,
        "the gripper was opened": len(lab.cell.delays) > opened and ending.message.startswith("stopped before the release"),
        "the arm moves": lab.cell.joint_speeds.any(),
        "the arm is armed": bool(lab.sent) and lab.gate.arming > 0,
        f"sent {beyond}": beyond,
        f"measured {used}": max(used["position"], used["speed"]) > 1.0,
    }
    return ending.message, "; ".join(line for line, so in wrong.items() if so)


def recover(lab: Lab) -> bool:
    """Ends the fault, arms the arm and brings it home; whether that had to be done by hand."""
    lab.meanwhile, lab.cell.fault = lambda: None, ""
    lab.rest(1.0)
    lab.gate.arm(lab.cell.time)
    by_hand = bool(lab.sent) and not lab.go_home().success
    if by_hand:
        lab.cell.desired = lab.cell.home.copy()
    lab.rest()
    return by_hand


def main() -> None:
    """Runs it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--throws", type=int, default=50, help="throws by each arm")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--uneven", type=float, default=0.0, help="the last joint is so much later than the first [s]")
    parser.add_argument("--arm", choices=FILES, help="only this one")
    arguments = parser.parse_args()
    if arguments.throws < FEWEST:
        parser.error(f"--throws: found {arguments.throws}, expected at least {FEWEST}")
    for name in [arguments.arm] if arguments.arm else FILES:
        lab = Lab(FILES[name], arguments.seed)
        lab.cell.uneven = arguments.uneven * np.linspace(-0.5, 0.5, len(lab.cell.names))
        print(f"{name}:", flush=True)
        throws = designed(lab, arguments.throws, arguments.seed)
        report_throws(lab, throws)
        report_faults(lab, throws[0])


if __name__ == "__main__":
    main()
