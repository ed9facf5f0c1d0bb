"""Where in a bag the kept tosses are: its motions with the log times that they and their surroundings were recorded in.

A toss must come out of a part of the recording as it came out of the whole. What came before it matters to how it is cut: a
motion that is not over, the period of the frames, on a bounded board that the body was away from it. `NEAR` takes somewhat
less than the time that separates two motions, so that nothing of another one is in it; `FAR` takes all up to the next motion.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from contact_curation.contact.body import Body
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.export.windows import Places, PoseTimes, Window
from contact_curation.storage.inputs.bag_tosses import BagTosses, bag_tosses
from contact_curation.storage.inputs.pose_source import PoseSource
from contact_curation.storage.inputs.records import Found, InputsConfig
from contact_curation.storage.provenance import TossProvenance

SHARE_OF_SETTLE_TIME = 0.8


class Surroundings(Enum):
    """How much around a toss is taken."""

    NEAR = "near"
    FAR = "far"


@dataclass(frozen=True, eq=False)
class Motion:
    """A toss or a motion that was rejected; what stays of it.

    Attributes:
        toss_id: of the toss.
        digest: of its content.
        places: of its poses.
    """

    toss_id: str
    digest: str
    places: Places


@dataclass(frozen=True, eq=False)
class Survey:
    """What is known of a bag once it was read.

    Attributes:
        origin: the bag.
        source: the topics that tell where the body is.
        motions: in their order.
        settle_ns: time that separates two motions.
        times: of the poses.
        left_out: what could not be used of it, one line each.
    """

    origin: TossProvenance
    source: PoseSource
    motions: tuple[Motion, ...]
    settle_ns: int
    times: PoseTimes
    left_out: tuple[str, ...]

    def kept(self, wanted: Mapping[str, object]) -> tuple[Motion, ...]:
        """Those whose ids are wanted; of two with one id the last, which is whole if one of them is."""
        return tuple({motion.toss_id: motion for motion in self.motions if motion.toss_id in wanted}.values())

    def window(self, motion: Motion, surroundings: Surroundings) -> Window:
        """The log times of a motion with its surroundings."""
        if surroundings is Surroundings.NEAR:
            margin_ns = int(SHARE_OF_SETTLE_TIME * self.settle_ns)
            return self.times.window(self.times.with_margins(motion.places, margin_ns, margin_ns))
        place = self.motions.index(motion)
        low = self.motions[place - 1].places.high + 1 if place else 0
        high = self.motions[place + 1].places.low - 1 if place + 1 < len(self.motions) else len(self.times) - 1
        return self.times.window(Places(min(low, motion.places.low), max(high, motion.places.high)))


def survey(reader: BagReader, body: Body, config: InputsConfig, advance: Callable[[int], None]) -> Survey:
    """Reads a bag's poses.

    Raises:
        MissingTopicError: no topic, or several, could tell where the body is.
    """
    tosses = bag_tosses(reader, body, config)
    times, motions = PoseTimes(), list[Motion]()
    for message in reader.messages(tosses.source.topics):
        if message.topic == tosses.source.body.name:
            times.note(message)
        for found in tosses.of(message):
            motions += _located(found, times)
            advance(1)
    motions += [motion for found in tosses.rest() for motion in _located(found, times)]
    left_out = tuple(f"{reader.path}: {line}" for line in (*tosses.left_out(), *reader.losses))
    settle_ns = round(tosses.settle_time * NANOSECONDS)
    return Survey(tosses.origin, tosses.source, tuple(motions), settle_ns, times, left_out)


def digests_in(reader: BagReader, body: Body, config: InputsConfig) -> dict[str, str]:
    """The digests of all motions of a bag, by their ids."""
    tosses: BagTosses = bag_tosses(reader, body, config)
    found = [one for message in reader.messages(tosses.source.topics) for one in tosses.of(message)]
    return {one.toss.toss_id: one.toss.digest() for one in (*found, *tosses.rest())}


def _located(found: Found, times: PoseTimes) -> list[Motion]:
    toss = found.toss
    places = times.places(int(toss.stamps_ns[0]), int(toss.stamps_ns[-1]), len(times))
    return [Motion(toss.toss_id, toss.digest(), places)] if places is not None else []
