"""rosbag2's YAML form of offered QoS profiles: written as Jazzy does, read in the forms of every release.

Up to metadata version 8 the policies are numbers, from version 9 (Jazzy) on they are names.
"""

import yaml

from contact_curation.storage.bags.records import OfferedQos

TRANSIENT_LOCAL = ("transient_local", 1)
BEST_EFFORT = ("best_effort", 2)
LARGEST_PROFILE = 1 << 16
"""Characters; longer texts are no QoS profiles, and YAML is slow."""

FOREVER = {"sec": 9223372036, "nsec": 854775807}
"""rmw's infinite duration, which stands for "not set"."""


def profiles_of(qos: OfferedQos) -> list[dict[str, object]]:
    """The list that goes into metadata.yaml."""
    return [
        {
            "history": "keep_last",
            "depth": qos.depth,
            "reliability": "reliable" if qos.reliable else "best_effort",
            "durability": "transient_local" if qos.latched else "volatile",
            "deadline": dict(FOREVER),
            "lifespan": dict(FOREVER),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(FOREVER),
            "avoid_ros_namespace_conventions": False,
        }
    ]


def profiles_text(qos: OfferedQos) -> str:
    """The text that goes into a channel's metadata."""
    return str(yaml.safe_dump(profiles_of(qos), sort_keys=False)).strip()


def qos_from(profiles: object) -> OfferedQos | None:
    """The QoS a topic was offered with: latched and reliable when any of its publishers was.

    Args:
        profiles: a list of profiles or YAML text of one.

    Returns:
        None where nothing can be read from `profiles`: QoS only guides a player, so bad QoS must not cost any messages.
    """
    if isinstance(profiles, str):
        profiles = _parsed(profiles)
    if not isinstance(profiles, list) or not profiles or not all(isinstance(profile, dict) for profile in profiles):
        return None
    depths = [profile.get("depth") for profile in profiles]
    return OfferedQos(
        latched=any(_policy(profile.get("durability")) in TRANSIENT_LOCAL for profile in profiles),
        reliable=any(_policy(profile.get("reliability")) not in BEST_EFFORT for profile in profiles),
        depth=max((depth for depth in depths if isinstance(depth, int)), default=OfferedQos.depth),
    )


def _policy(value: object) -> object:
    return value.lower() if isinstance(value, str) else value


def _parsed(text: str) -> object:
    if len(text) > LARGEST_PROFILE:
        return None
    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError):
        return None
