"""The parameters of a design, by the names that `--set` of `contact-curation design` has for them."""

from dataclasses import replace

from rclpy.node import Node

from contact_curation.contact.body import Body
from contact_curation.contact.parameter_form import Form
from contact_curation.design.candidates import CandidateConfig
from contact_curation.design.designer import ONE_THREAD, DesignerConfig
from contact_curation.design.planner import DesignConfig
from contact_curation.design.readiness import ReadinessConfig
from contact_curation.design.safety import Feasible
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.stages.throw_loop import LoopConfig

WAITING = "how long to wait after that until the trainer has used all tosses [s]; 0: design with the present theta"

JUDGED = ("forecast", "safety", "noise", "placement")


def declared_thrower(node: Node, body: Body) -> Feasible | None:
    """Declares `thrower` and returns the function that decides which throws it can make; None if it is empty or `none`.

    Raises:
        InvalidValueError: the arm's parameters are invalid.
    """
    described = "arm: only throws that sim_arm can make, with its parameters arm.*; none or empty: a thrower of your own"
    if declare(node, "thrower", "", described, choices=("", "none", "arm")) != "arm":
        return None
    from contact_curation.simulation.arm.feasibility import ArmFeasibility
    from contact_curation.simulation.arm.model import ArmConfig  # MuJoCo takes a while to import
    from contact_curation.simulation.arm.safety import GateConfig
    from contact_curation.simulation.arm.throw_motion import ThrowPlanner

    arm = declare_config(node, ArmConfig(), "arm.")
    return ArmFeasibility(ThrowPlanner(body, arm), GateConfig(keep_out_place=(arm.base[0], arm.base[1])))


def declared_design(node: Node) -> DesignerConfig:
    """Declares the parameters of the design of throws.

    Raises:
        InvalidValueError: a value is not accepted.
        rclpy.exceptions.ParameterException: a value has another type.
    """
    default = DesignConfig()
    described = {
        "pool": "number of safe candidate throws",
        "sieve": "simulated executions of each candidate in the first stage, which finds the finalists",
        "finalists": "number of candidates that are evaluated with all executions",
        "reference": "number of reference throws, for the prior information and the readiness check",
        "share": "the prior information is this share of the mean information of the reference throws",
    }
    own = {name: declare(node, f"design.{name}", getattr(default, name), text) for name, text in described.items()}
    candidates = CandidateConfig()
    judged = {name: declare_config(node, getattr(candidates, name), f"{name}.") for name in JUDGED}
    refinement = declare_config(node, default.refinement, "refinement.")
    about = "parameterisation of a theta with one set of vertices, the same as fisher_scorer's"
    form = Form(declare(node, "form", Form.RIGID.value, about, choices=[Form.RIGID.value, Form.PHYSICAL.value]))
    return DesignerConfig(
        planner=replace(default, **own, candidates=replace(candidates, **judged), refinement=refinement),
        readiness=declare_config(node, ReadinessConfig(), "readiness."),
        loss=declare_config(node, ONE_THREAD, "loss."),
        form=form,
    )


def declared_loop(node: Node) -> LoopConfig:
    """Declares how many throws `auto` makes, and how long it waits."""
    default = LoopConfig()
    return LoopConfig(
        declare(node, "max_throws", default.max_throws, "stop after this many throws in auto; 0: no end", bounds=(0, 1 << 31)),
        declare(
            node, "toss_timeout", default.toss_timeout, "how long to wait for the toss of a throw [s]", bounds=(0.0, 3600.0)
        ),
        declare(node, "theta_timeout", default.theta_timeout, WAITING, bounds=(0.0, 3600.0)),
        declare(node, "retry_period", default.retry_period, "pause after a throw that was not made [s]", bounds=(0.1, 3600.0)),
        declare(
            node,
            "goal_timeout",
            default.goal_timeout,
            "time without feedback after which a throw is given up [s]",
            bounds=(0.1, 3600.0),
        ),
    )
