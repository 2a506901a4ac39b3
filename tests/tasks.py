"""Which tasks a test is about."""

from tagtrack.envs.scenario import SCENARIOS

LONE = [env_id for env_id, scenario in SCENARIOS.items() if scenario.vehicles * scenario.targets == 1]  # one vehicle, one tag
