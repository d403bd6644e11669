"""Settings survive the way through JSON, and what is wrong with them is named."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import Json
from roboscribe.rl.config import CloneConfig, PpoConfig, SacConfig, TrainConfig
from roboscribe.stages import train
from roboscribe.stages.runtime.configuration import decode, encode
from roboscribe.stages.runtime.task_config import TaskConfig

CONFIG = train.Config(
    TaskConfig("point-pick-place-1", timing="faithful"),
    goal="at",
    seed=3,
    training=replace(TrainConfig(profile="states"), learner=SacConfig(updates=3), clone=CloneConfig(hidden=(8, 8, 8))),
    afresh=("hold",),
)


def test_a_nested_config_survives_json() -> None:
    assert decode(train.Config, json.loads(json.dumps(encode(CONFIG)))) == CONFIG


def test_what_is_left_out_has_its_default() -> None:
    assert decode(train.Config, {"task": {"name": "a"}}) == train.Config(TaskConfig("a"))


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ({}, "task"),
        ({"task": {"name": "a"}, "sed": 1}, "found 'sed'"),
        ({"task": {"name": "a"}, "seed": "1"}, r"config.seed: found '1', expected int"),
        ({"task": {"name": "a"}, "seed": True}, r"config.seed: found True, expected int"),
        ({"task": {"name": "a"}, "training": {"profile": "all"}}, r"config.training.profile: found 'all'"),
        ({"task": "a"}, r"config.task: found 'a', expected an object with name, contact, timing"),
    ],
)
def test_what_is_wrong_is_named(value: Json, said: str) -> None:
    with pytest.raises(ArtifactError, match=said):
        decode(train.Config, value, "config")


def test_a_learner_is_known_by_the_names_of_its_settings() -> None:
    assert decode(TrainConfig, {"learner": {"tau": 0.1}}).learner == SacConfig(tau=0.1)
    assert decode(TrainConfig, {"learner": {"clip": 0.1}}).learner == PpoConfig(clip=0.1)
    with pytest.raises(ArtifactError, match="found 'tua'"):
        decode(TrainConfig, {"learner": {"tua": 0.1}})


def test_only_plain_values_are_settings() -> None:
    with pytest.raises(TypeError, match="set"):
        encode({"a": {1, 2}})
