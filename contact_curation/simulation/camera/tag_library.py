"""The AprilTag library, as pupil-apriltags wraps it."""

from typing import Any, NamedTuple

from contact_curation.errors import MissingDependencyError
from contact_curation.geometry.tags import FAMILY


class TagLibrary(NamedTuple):
    """A detector of the library and the table of the family it looks for.

    Attributes:
        detector: `pupil_apriltags.Detector`.
        family: the library's structure with codes and places of bits.
    """

    detector: Any
    family: Any


def tag_library(**options: Any) -> TagLibrary:
    """A detector for the family 36h11.

    The wrapper (1.0.4) frees a detector's families before the detector, which then reads them: a crash now and then
    (pupil-labs/apriltags, issues 34 and 46). So the family is taken out of its hands, and never freed.

    Args:
        options: of the wrapper's Detector.

    Raises:
        MissingDependencyError: the library is not installed.
    """
    try:
        from pupil_apriltags import Detector  # type: ignore[import-untyped]
    except ImportError as error:
        raise MissingDependencyError("the AprilTag library", "pip install pupil-apriltags") from error
    detector = Detector(FAMILY, **options)
    return TagLibrary(detector, detector.tag_families.pop(FAMILY))
