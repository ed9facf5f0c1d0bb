"""Lines of a growing log are found once each, and only when they are complete."""

from pathlib import Path

from contact_curation.session.log_follower import LogFollower
from contact_curation.session.session import NO_THROW


def test_each_complaint_of_the_designer_is_found_once_and_whole(tmp_path: Path) -> None:
    path = tmp_path / "throw_designer.log"
    follower = LogFollower(path, NO_THROW)
    assert follower.new() == []
    with path.open("a") as log:
        log.write("[WARN] [1.2] [throw_designer]: no throw: releases: found 0; dropped\n[WARN] [1.3] no throw: the co")
        log.flush()
        assert follower.new() == ["releases: found 0"]
        assert follower.new() == []
        log.write("mpiled kernel (expected it; here) (7 times so far); dropped\nother\n")
        log.flush()
    assert follower.new() == ["the compiled kernel (expected it; here)"]
