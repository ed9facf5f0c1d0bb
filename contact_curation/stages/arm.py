"""The work of sim_arm without threads, topics or a clock: one goal at a time through safety gate, planner and simulation.

Every call is given the time of a steady clock. `admits` may be called from any thread, everything else belongs to one.
"""

from typing import NamedTuple

from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.feasibility import ArmFeasibility, described
from contact_curation.simulation.arm.frame import ArmFrame, Phase
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.safety import SafetyGate, path_out_of_limits
from contact_curation.simulation.arm.simulation import ArmSimulation, ControlConfig


class Ending(NamedTuple):
    """The outcome of a goal.

    Attributes:
        success: whether the throw was made, the body rests and the arm is home.
        message: one line.
        executed: the throw as it was really executed; None if the body was not released.
        released_at: simulated time of that [s].
    """

    success: bool
    message: str
    executed: Throw | None = None
    released_at: float = 0.0


class ArmStage:
    """The simulated arm behind its gate.

    Args:
        feasibility: what it can do, and how.
        gate: that every command passes.
        control: of its motions.
        seed: of the gripper's delays.
    """

    def __init__(self, feasibility: ArmFeasibility, gate: SafetyGate, control: ControlConfig, seed: int) -> None:
        self._feasibility, self._gate = feasibility, gate
        planner = feasibility.planner
        self._simulation = ArmSimulation(planner.body, planner.config, control, seed)
        self._throw: Throw | None = None
        self._begun = False
        self._arming = 0
        self._stopped_for = ""

    @property
    def busy(self) -> bool:
        """Whether a goal is under way, or the arm on its way home."""
        return self._throw is not None or self._simulation.phase not in (Phase.RESTING, Phase.STOPPED)

    @property
    def waits(self) -> bool:
        """Whether a goal was taken and has not begun."""
        return self._throw is not None and not self._begun

    @property
    def phase(self) -> Phase:
        """Of the arm."""
        return self._simulation.phase

    @property
    def time(self) -> float:
        """Simulated [s]."""
        return self._simulation.time

    def admits(self, throw: Throw, now: float) -> str | None:
        """Takes a goal, or says in one line why not."""
        if self._throw is not None:
            return f"busy with throw {self._throw.throw_id}, expected one goal at a time"
        refusal = self._gate.admits(throw, now)
        if refusal is None:
            self._begun, self._arming, self._stopped_for = False, self._gate.arming, ""
            self._throw = throw  # last: from now on the other thread may begin it
        return refusal

    def begin(self) -> Ending | None:
        """Plans the goal that was taken and begins it; its ending if it cannot be."""
        throw = self._throw
        if throw is None:
            return None
        if self._simulation.phase is not Phase.RESTING:
            return self._ended(Ending(False, f"the arm is {self._simulation.phase.value}, expected it at rest at home"))
        motion = self._feasibility.motion(throw)
        if isinstance(motion, str):
            nearest = self._feasibility.nearest(throw)
            instead = f"; the nearest feasible throw is {described(nearest)}" if nearest else ""
            return self._ended(Ending(False, motion + instead))
        whole = JointPath.joined(motion.approach, motion.swing, motion.stopping, motion.returning)
        against = path_out_of_limits(whole, self._feasibility.planner.config.limits)
        if against is not None:
            return self._ended(Ending(False, against))
        if self._gate.arming != self._arming:
            return self._ended(Ending(False, f"stopped before it began: {self._gate.reason or 'armed again since'}"))
        self._simulation.begin(motion)
        self._begun = True
        return None

    def cancel(self) -> None:
        """Brakes; the arm goes home by itself while the gate is armed."""
        self._stop("cancelled")

    def advance(self, now: float) -> tuple[ArmFrame, Ending | None]:
        """The next frame of the simulated world, and the goal's ending if this was it."""
        simulation = self._simulation
        if not self._gate.watch(now):
            self._stop(self._gate.reason)
        elif simulation.phase is Phase.STOPPED:
            simulation.rearm()
        return simulation.advance(), self._ending()

    @property
    def stands_still(self) -> bool:
        """Whether nothing moves, and the gate wants nothing else: without a goal simulated time need not run."""
        stopped = self._simulation.phase is Phase.STOPPED
        return not self.busy and stopped != bool(self._gate.arming)

    def frame(self) -> ArmFrame:
        """The world as it is."""
        return self._simulation.frame()

    def _stop(self, reason: str) -> None:
        if self._simulation.phase not in (Phase.STOPPED, Phase.STOPPING):
            self._stopped_for = self._stopped_for or reason
            self._simulation.stop()

    def _ending(self) -> Ending | None:
        if self._throw is None or not self._begun:
            return None
        release, released_at = self._simulation.release, self._simulation.released_at
        executed = None if release is None else self._executed(release)
        if self._simulation.phase is Phase.STOPPED:
            when = "before" if release is None else "after"
            return self._ended(Ending(False, f"stopped {when} the release: {self._stopped_for}", executed, released_at))
        if self._simulation.phase is Phase.RESTING:
            return self._ended(Ending(True, f"thrown{self._remarks()}", executed, released_at))
        return None

    def _remarks(self) -> str:
        """What else a throw's result has to say."""
        simulation = self._simulation
        gave_way = ", which gave way" if simulation.gave_way else ""
        touched = f"; the body touched the arm{gave_way}" if simulation.touched else ""
        return touched + ("" if simulation.settled else "; the body did not come to rest")

    def _executed(self, release: Array) -> Throw:
        assert self._throw is not None
        throw = self._throw
        return throw_of_state(throw.throw_id, throw.body, release, throw.expected_information, throw.parameters_version)

    def _ended(self, ending: Ending) -> Ending:
        self._throw = None
        return ending
