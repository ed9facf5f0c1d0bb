"""Declares the fields of a config dataclass as ROS parameters.

Names of parameters are field paths, descriptions come from the class's docstring, and the class checks the values. A field that
is itself a config gives names with dots (`gates.depth`). For a field that may be None, 0.0 stands for None, because a ROS
parameter has one type; its description says so.
"""

from collections.abc import Sequence
from enum import Enum
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from contact_curation.configs import accepted_range, fields_of
from contact_curation.errors import UnknownNameError
from contact_curation.stages.parameters import as_parameter, with_parameters

DERIVED = "; 0: this default"
"""End of the description of a field whose default is None."""


def declare(
    node: Node,
    name: str,
    default: Any,
    description: str,
    *,
    bounds: tuple[float, float] | None = None,
    choices: Sequence[str] = (),
    fixed: bool = True,
) -> Any:
    """Declares a parameter and returns its value.

    Args:
        node: node that has the parameter.
        name: name with dots between its parts.
        default: default value, which also determines the type.
        description: text for `ros2 param describe`.
        bounds: smallest and largest accepted number.
        choices: accepted words; empty for any.
        fixed: whether the parameter cannot be changed while the node runs.

    Raises:
        InvalidValueError: the value is not among the choices.
        rclpy.exceptions.ParameterException: the value has another type or is out of bounds.
    """
    descriptor = ParameterDescriptor(description=description, read_only=fixed)
    if choices:
        descriptor.additional_constraints = f"one of {', '.join(word or "''" for word in choices)}"
    if bounds is not None and isinstance(default, int):
        descriptor.integer_range = [IntegerRange(from_value=int(bounds[0]), to_value=int(bounds[1]))]
    elif bounds is not None and isinstance(default, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=bounds[0], to_value=bounds[1])]
    value = node.declare_parameter(name, default, descriptor).value
    if value is None and isinstance(default, list):
        # An empty list has no type, and rclpy takes it for no value, of which `ros2 param dump` makes nonsense for all others.
        value = []
        node._parameters[name] = Parameter(name, Parameter.Type.from_parameter_value(default), value)
    if choices and value not in choices:
        raise UnknownNameError(f"{name}", value, choices)
    return value


def declare_config[Config](node: Node, default: Config, prefix: str = "", *, fixed: bool = True) -> Config:
    """Declares every field of a config as a parameter and returns the config with their values.

    Args:
        node: node that has the parameters.
        default: config with the default values, a frozen dataclass.
        prefix: prefix of the parameters' names, including its dot.
        fixed: whether the parameters cannot be changed while the node runs.

    Raises:
        InvalidValueError: the config does not accept a value.
        rclpy.exceptions.ParameterException: a value has another type.
    """
    values: dict[str, Any] = {}
    for field in fields_of(default):
        choices = [str(member.value) for member in type(field.default)] if isinstance(field.default, Enum) else ()
        name = prefix + field.path
        values[name] = declare(
            node,
            name,
            as_parameter(field.default),
            field.description.rstrip(".") + DERIVED if field.default is None else field.description,
            bounds=accepted_range(default, field),
            choices=choices,
            fixed=fixed,
        )
    return with_parameters(default, values, prefix)
