"""The rules a recording was cut by, kept in the recording itself.

ContactNets' data need it: its cube rests 1.2 mm low, and a rest at 0.052 m or higher went unseen when its tosses were cut
(`motion.segmenter_config`). Another reader of the same bag gets the same tosses without being told.
"""

from collections.abc import Mapping
from dataclasses import replace

from contact_curation.errors import InvalidValueError
from contact_curation.motion.segmenter_config import SegmenterConfig

NOTE = "contact_curation.segmenter"
UNSET = SegmenterConfig()
"""By default the rest height follows from the body, and the frame period from the stamps; a recording may know better."""


def note_of_rules(rules: SegmenterConfig) -> dict[str, str]:
    """The note that says a recording's rest height [m] and frame period [s], where they are set."""
    known = {"rest_height": (rules.rest_height, UNSET.rest_height), "frame_period": (rules.frame_period, UNSET.frame_period)}
    return {name: repr(value) for name, (value, unset) in known.items() if value != unset}


def with_recorded_rules(rules: SegmenterConfig, note: Mapping[str, str]) -> SegmenterConfig:
    """`rules`, completed by what a recording says; what its user has set stays.

    Raises:
        InvalidValueError: the note does not hold positive numbers.
    """
    try:
        said = {name: float(value) for name, value in note.items()}
    except ValueError as error:
        raise InvalidValueError(f"note {NOTE} of the recording", dict(note), "numbers") from error
    if rules.rest_height == UNSET.rest_height and "rest_height" in said:
        rules = replace(rules, rest_height=said["rest_height"])
    if rules.frame_period is None and "frame_period" in said:
        rules = replace(rules, frame_period=said["frame_period"])
    return rules
