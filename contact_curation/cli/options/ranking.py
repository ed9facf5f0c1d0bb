"""Checks options of a ranking together."""

from contact_curation.errors import InvalidValueError
from contact_curation.information.ranker import RankingConfig

WITH_VARIANTS = "orthogonal"


def check_variant(given: str | None, ranking: RankingConfig) -> None:
    """Refuses `--variant` beside a criterion that has none.

    Args:
        given: value of `--variant`; None where it was not given.
        ranking: as all options have it.

    Raises:
        InvalidValueError: the criterion has no variants.
    """
    if given is not None and ranking.criterion != WITH_VARIANTS:
        expected = f"--criterion {WITH_VARIANTS}, which it belongs to"
        raise InvalidValueError("--variant", f"{given} with criterion {ranking.criterion}", expected)
