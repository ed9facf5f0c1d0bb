"""The ranking of a session's bag is by what its curator ranked by, named or not."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from contact_curation.cli.main import build_parser
from contact_curation.cli.rank.command import rank_config
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.offline_ranking import offline_ranking, rank_command


@pytest.mark.parametrize(
    ("curator", "criterion"),
    [
        ({}, None),
        ({"selection": "exact", "criterion": "representative"}, "representative"),
        ({"selection": "streaming"}, None),
        ({"selection": "streaming", "criterion": "trace"}, "trace"),
    ],
)
def test_a_criterion_that_was_named_is_an_option(tmp_path: Path, curator: dict[str, Any], criterion: str | None) -> None:
    parameters = {"pose_ingest": {}, "fisher_scorer": {}, "curator": curator}
    words = rank_command(SessionConfig(), SessionFolder(tmp_path), parameters)
    named = words[words.index("--criterion") + 1] if "--criterion" in words else None
    assert named == criterion


@pytest.mark.parametrize(
    "told",
    [
        {"pose_ingest": {}, "fisher_scorer": {}, "curator": {}},
        {
            "pose_ingest": {
                "topic": "/tagslam/odom/body_cube",
                "body_frame": "body_cube",
                "segmenter.rest_frames": 5,
                "segmenter.region_x": [-1.0, 1.0],
                "gates.depth": 0.01,
                "rig.normal": [0.01, 0.0, 1.0],
            },
            "fisher_scorer": {"estimator": "empirical", "influence_bound": 3.5, "loss.cone": "polyhedral"},
            "curator": {"criterion": "trace", "top": 5, "seed": 3, "prior": 0.01},
        },
    ],
)
def test_the_recorded_command_asks_for_the_ranking_that_the_session_made(tmp_path: Path, told: dict[str, Any]) -> None:
    folder, session = SessionFolder(tmp_path), SessionConfig()
    own = offline_ranking(session, CONTACTNETS_CUBE, folder, told)
    words = rank_command(session, folder, told)[1:]
    asked = rank_config(build_parser(words).parse_args(words, argparse.Namespace(command=tuple(words))))
    assert asked.pool.reading.inputs == own.pool.reading.inputs
    assert replace(asked.pool.scoring, loss=own.pool.scoring.loss) == own.pool.scoring
    assert asked.pool.scoring.loss.cone == own.pool.scoring.loss.cone
    assert (asked.ranking, asked.model, asked.parameters) == (own.ranking, own.model, own.parameters)
