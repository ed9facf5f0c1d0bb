"""Online curation of contact-rich robot tosses: which tosses are informative, which to select, what to throw next.

    import contact_curation as cc

The names below are imported when they are first used, so that `import contact_curation` takes no time (PEP 562).
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from contact_curation.version import __version__ as __version__

if TYPE_CHECKING:
    from contact_curation.contact.body import Body
    from contact_curation.motion.toss import Toss
    from contact_curation.pipeline.api import check, design, evaluate, rank, read, score, train
    from contact_curation.pipeline.design import DesignedThrows
    from contact_curation.pipeline.diagnosis import Diagnosis
    from contact_curation.pipeline.evaluated import Evaluation
    from contact_curation.pipeline.learned_model import LearnedModel, load_model
    from contact_curation.pipeline.ranked import RankedTosses
    from contact_curation.pipeline.recordings.poses import write_poses
    from contact_curation.pipeline.toss_scores import TossScores
    from contact_curation.pipeline.tosses import Tosses
    from contact_curation.storage.body_file import write_body

__all__ = [
    "Body",
    "DesignedThrows",
    "Diagnosis",
    "Evaluation",
    "LearnedModel",
    "RankedTosses",
    "Toss",
    "TossScores",
    "Tosses",
    "check",
    "design",
    "evaluate",
    "load_model",
    "rank",
    "read",
    "score",
    "train",
    "write_body",
    "write_poses",
]

_HOMES = {
    "Body": "contact.body",
    "Toss": "motion.toss",
    "Diagnosis": "pipeline.diagnosis",
    "Tosses": "pipeline.tosses",
    "RankedTosses": "pipeline.ranked",
    "TossScores": "pipeline.toss_scores",
    "LearnedModel": "pipeline.learned_model",
    "Evaluation": "pipeline.evaluated",
    "DesignedThrows": "pipeline.design",
    "load_model": "pipeline.learned_model",
    "write_body": "storage.body_file",
    "write_poses": "pipeline.recordings.poses",
    **dict.fromkeys(("read", "check", "score", "rank", "train", "evaluate"), "pipeline.api"),
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    imported = import_module(f"{__name__}.extras").says_what_to_install(import_module)
    value = getattr(imported(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value  # so that it is looked for once
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _Face(ModuleType):
    """`design` is a function here, though a part of the package has this name, too: importing the part does not change that."""

    @property
    def design(self) -> Any:
        return import_module(f"{__name__}.pipeline.api").design

    @design.setter
    def design(self, part: ModuleType) -> None:
        """Where Python would note the part."""


sys.modules[__name__].__class__ = _Face
