"""Whom a learned policy must beat where nobody is named."""

import pytest

from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task, build_task
from tagtrack.eval.rivals import OF_FLEETS, OF_SEVERAL_TAGS, OTHERS, RIVALS, rivals_of


@pytest.mark.parametrize("env_id", sorted(RIVALS))
def test_rivals_of_an_id_can_steer_in_it(env_id):
    task = build_task(env_id, particles=10)
    assert rivals_of(task) == RIVALS[env_id]
    simulation = Simulation(task.scenario)
    for spec in RIVALS[env_id]:
        make_baseline(spec, simulation)


def test_numbers_tuned_for_one_fleet_are_no_other_fleets():
    assert rivals_of(build_task("GliderPair-v0", vehicles=3)) == OF_SEVERAL_TAGS
    assert rivals_of(build_task("LeopardShark-v0", vehicles=2)) == OF_FLEETS


def test_a_scenario_of_ones_own_has_the_usual_ones():
    assert rivals_of(Task(SCENARIOS["TagTrack/Glider-v0"])) == OTHERS
