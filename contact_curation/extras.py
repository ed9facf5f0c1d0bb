"""The optional libraries, by the extra of the package that installs them (setup.py, EXTRAS).

Ranking a polytope needs none of them. They are imported where they are used, often inside functions; where one is missing, the
entry points of the command line, of the nodes and of `import contact_curation as cc` say what to install.
"""

from collections.abc import Callable
from functools import wraps
from importlib.util import find_spec

from contact_curation.errors import ContactCurationError, MissingDependencyError, UnloadableLibraryError

EXTRA_OF = {
    "torch": "train",
    "fsspec": "cloud",
    "ray": "ray",
    **dict.fromkeys(("cv2", "daqp", "mink", "mujoco", "pupil_apriltags"), "sim"),
    "rerun": "dashboard",
    **dict.fromkeys(("rclpy", "contact_curation_msgs", "apriltag_msgs", "tf2_msgs", "nav_msgs", "sensor_msgs"), "ros"),
}
"""Import name of an optional library, and the extra that installs it."""


def missing_extra(error: ImportError) -> ContactCurationError:
    """The error to raise in place of `error`, which says what to install, or what the system cannot load.

    Raises:
        ImportError: `error` itself, where no extra has the module or it is installed.
    """
    if not isinstance(error, ModuleNotFoundError):
        if error.path is None or error.name_from:  # no library of the system: a name that a module lacks
            raise error
        return UnloadableLibraryError(error.path, error)
    library = (error.name or "").split(".")[0]
    if library not in EXTRA_OF or find_spec(library) is not None:
        raise error
    return MissingDependencyError(library, f"pip install 'contact-curation[{EXTRA_OF[library]}]'")


def says_what_to_install[**P, T](function: Callable[P, T]) -> Callable[P, T]:
    """Decorates a public function: an optional library that it misses is an error that names the extra."""

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except ImportError as error:
            raise missing_extra(error) from error

    return guarded
