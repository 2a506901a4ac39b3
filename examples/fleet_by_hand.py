"""A fleet by hand, through PettingZoo: each vehicle sails for the tag whose estimate is nearest to it.

    python fleet_by_hand.py

Three vehicles among two tags share what they hear by packets that take turns; it prints what they know at the end of each minute.
"""

import numpy as np
import pettingzoo

import tagtrack  # noqa: F401 - registers the ids
from tagtrack.envs.layout import feature_names, split_observation

env = pettingzoo.make("parallel", "tagtrack/leopard_shark_v0", vehicles=3, tags=2, modem="tdma", max_cycles=150)
scenario = env.unwrapped.simulation.scenario
names = [name.removeprefix("tag_0.") for name in feature_names(scenario)]
DISTANCE, COS, SIN = names.index("distance"), names.index("bearing_cos"), names.index("bearing_sin")


def nearest_tag(observation: np.ndarray) -> np.ndarray:
    """A course relative to the own heading, towards the nearest estimate."""
    tags = split_observation(observation, scenario)["tags"]
    nearest = tags[tags[:, DISTANCE].argmin()]
    return np.array([nearest[COS], nearest[SIN]], np.float32)


observations, infos = env.reset(seed=0)
while env.agents:  # a vehicle whose battery is empty leaves; here they have no end
    actions = {agent: nearest_tag(observations[agent]) for agent in env.agents}
    observations, rewards, terminations, truncations, infos = env.step(actions)
    minute, rest = divmod(env.unwrapped.simulation.worlds.clock["step"][0] * scenario.time_step, 60.0)
    if rest == 0.0:
        told = ", ".join(f"{agent} {info['localization_error']:.0f} m" for agent, info in infos.items())
        print(f"minute {minute:.0f}: mean error over both tags {told}; {infos['auv_0']['received']} messages came to auv_0")
env.close()
