"""How tosses are scored for networks, as plain numbers that cost no import of torch."""

import re
from dataclasses import dataclass, field

from contact_curation.configs import set_whole_numbers
from contact_curation.contact.models.defaults import ModelDefaults
from contact_curation.contact.models.registry import model_class, model_entry
from contact_curation.errors import InvalidValueError


@dataclass(frozen=True)
class SketchConfig:
    """How large a sketched gradient is (`network.sketch`).

    Attributes:
        leading: rows of each projection that are leading directions of the reference.
        random: rows of each projection that are random.
        seed: random seed of the random rows and of the reference.
    """

    leading: int = 16
    random: int = ModelDefaults.sketch_rows
    seed: int = 0

    def __post_init__(self) -> None:
        set_whole_numbers(self, ("leading", "random", "seed"), prefix="sketch.")
        if self.size < 1:
            raise InvalidValueError("sketch", "no rows", "at least 1 row, leading or random")

    @property
    def size(self) -> int:
        """Rows of a projection."""
        return self.leading + self.random


CPU = "cpu"

GPU_MEMORY_MB = 4096
"""Default of `Device.memory_mb` on a GPU: over 2,000 transitions of any model, and room for others on a GPU of 8 GB."""


@dataclass(frozen=True)
class Device:
    """Where PyTorch evaluates networks. It changes the last digits of scores only, so no score is kept under its name.

    Attributes:
        name: ``cpu``, ``cuda`` or ``cuda:N``.
        memory_mb: memory for the transitions that are evaluated together [MB], weights and PyTorch itself not counted; 0
            evaluates each toss by itself, so that no digit depends on the other tosses; None for 0 on the CPU and
            `GPU_MEMORY_MB` on a GPU.

    Raises:
        InvalidValueError: PyTorch has no such device, or the memory is negative.
    """

    name: str = CPU
    memory_mb: int | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", str(self.name))  # a torch.device, too
        if not re.fullmatch(r"cpu|cuda(:\d+)?", self.name):
            raise InvalidValueError("device", self.name, "cpu, cuda or cuda:N")
        if self.memory_mb is not None and self.memory_mb < 0:
            raise InvalidValueError("device memory", self.memory_mb, "at least 0 MB")
        if not self.is_cpu:
            self._check_there()

    @property
    def is_cpu(self) -> bool:
        return self.name == CPU

    @property
    def memory(self) -> int:
        """As `memory_mb`, without None."""
        return self.memory_mb if self.memory_mb is not None else 0 if self.is_cpu else GPU_MEMORY_MB

    def _check_there(self) -> None:
        import torch  # takes over a second to import

        count = torch.cuda.device_count() if torch.cuda.is_available() else 0
        if int(self.name.partition(":")[2] or 0) < count:
            return
        known = ", ".join(["cpu", *(f"cuda:{number}" for number in range(count))])
        why = f"PyTorch {torch.__version__} finds {count or 'no'} CUDA devices; see nvidia-smi"
        raise InvalidValueError("device", self.name, f"one of {known} ({why})")


@dataclass(frozen=True)
class NetworkConfig:
    """Settings for networks; a model has a form of its own, so that that of `ScoringConfig` says nothing.

    Attributes:
        draws: backward passes per transition that stand for the Gauss-Newton matrix (method.md 1.5), all but one along its
            strongest directions (`leading_slopes`); a model without impulses to solve for, and explicit parameters alone, are
            taken exactly.
        seed: random seed of the draws.
        sketch: how gradients are projected.
        physical_only: whether only the parameters outside the networks count, of a deep model those of its polytope.
    """

    draws: int = 6
    seed: int = 0
    sketch: SketchConfig = field(default_factory=SketchConfig)
    physical_only: bool = False

    def __post_init__(self) -> None:
        set_whole_numbers(self, ("draws",), 1, prefix="network.")
        set_whole_numbers(self, ("seed",), prefix="network.")


def network_config_for(model: str) -> NetworkConfig:
    """The default for a model: a sketch that meets method.md 6, check 15, for it.

    Raises:
        InvalidValueError: there is no such model.
    """
    if model_entry(model).is_geometry:
        return NetworkConfig()
    return NetworkConfig(sketch=SketchConfig(random=model_class(model).defaults.sketch_rows))
