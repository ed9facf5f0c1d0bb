"""A device that computes on the CPU and is as strict as a GPU: tensors of the two do not mix, and NumPy sees only the CPU's.

PyTorch's `meta` stands in for the GPU. Its tensors carry numbers here, so that the path from poses to records can be tested
without a GPU.
"""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves, tree_map

NAME = "meta"


class Pretended(Tensor):
    """A tensor that says it is on the device.

    Attributes:
        on_cpu: its numbers.
    """

    on_cpu: Tensor

    @staticmethod
    def __new__(cls: type, on_cpu: Tensor) -> "Pretended":
        made: Pretended = Tensor._make_wrapper_subclass(
            cls, on_cpu.size(), on_cpu.stride(), on_cpu.storage_offset(), dtype=on_cpu.dtype, device=torch.device(NAME)
        )
        return made

    def __init__(self, on_cpu: Tensor) -> None:
        self.on_cpu = on_cpu

    def tolist(self) -> Any:
        """As of a GPU's tensor."""
        return self.on_cpu.tolist()

    @classmethod
    def __torch_dispatch__(cls, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:  # type: ignore[override]
        return computed(func, args, kwargs or {})


class PretendedDevice(TorchDispatchMode):  # type: ignore[no-untyped-call]
    """While it is entered, `meta` is a device with numbers."""

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return computed(func, args, kwargs or {})


def computed(func: Callable[..., Any], args: Any, kwargs: dict[str, Any]) -> Any:
    """What an operation gives, on the device where its arguments are or where it is told to put it."""
    given = [value for value in tree_leaves((args, kwargs)) if isinstance(value, Tensor)]
    there = [value for value in given if isinstance(value, Pretended)]
    here = [value for value in given if not isinstance(value, Pretended) and value.ndim > 0]
    copies = func in (torch.ops.aten.copy_.default, torch.ops.aten._to_copy.default)
    if there and here and not copies:
        raise RuntimeError(f"{func}: tensors of the CPU {[tuple(one.shape) for one in here]} and of the device")
    told = kwargs.get("device")
    on_device = bool(there) if told is None else torch.device(told).type == NAME
    inner_args, inner_kwargs = tree_map(lambda value: value.on_cpu if isinstance(value, Pretended) else value, (args, kwargs))
    if told is not None:
        inner_kwargs["device"] = "cpu"
    found = func(*inner_args, **inner_kwargs)
    known = {id(value.on_cpu): value for value in there}

    def placed(value: Any) -> Any:
        if not isinstance(value, Tensor):
            return value
        if not on_device:
            return value.clone() if told is not None and any(value is one.on_cpu for one in there) else value
        return known[id(value)] if id(value) in known else Pretended(value)

    return tree_map(placed, found)
