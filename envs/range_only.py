"""The Gymnasium environment of range-only tracking. All it adds to ``single.py`` is what its task is."""

from __future__ import annotations

from typing import ClassVar

from tagtrack.envs.single import TagTrackEnv


class RangeOnlyEnv(TagTrackEnv):
    """An AUV at the surface follows a tag by slant ranges alone (Masmitja et al. 2020, Eq. 21; Masmitja et al. 2023).

    Every 10 s the vehicle asks the tag for its range, and one time in ten there is no answer. Ranges have a noise of 5 m and
    are 1 % too long, which the filter does not know. The depth of the fish, drawn for each episode from 10 to 60 m, is
    known. One range leaves a ring, two leave a mirror image: where the fish is, is told by the vehicle's path, and not
    from right above it, where the range is all depth. One step is 10 s, an episode an hour.

    * ``TagTrack/RangeOnly-v0``: keep the localization error low.
    * ``TagTrack/RangeOnlyGlider-v0``: a vehicle of 0.5 m/s, a fish of up to 0.2 m/s, at most 250 m away at first.

    ## Presets

    Settings of the two learning systems in use today, for figures beside theirs (``preset=NAME``; ``envs/presets.py``):

    * ``masmitja2023``: steps of 30 s, 200 steps; turns of at most 0.3 rad a step; a target that swims straight at up to
      0.6 m/s, 15 to 300 m deep; a current of up to 0.3 m/s on the vehicle; ranges 1 % too long, give or take 1 m, up to 900 m.
      One start in ten is beyond that, where nothing is heard: here the filter weighs silence, too (``max_range``), so that
      the belief shows where the target may still be.
    * ``utracking_medium``, ``utracking_hard``: steps of 30 s, 256 steps; turns of at most 1.45 rad a step, with noise on heading
      and speed; a target on straight legs at 0.2 to 0.5 m/s (hard: 0.5 to 0.7 m/s, more turns), 5 to 20 m deep; ranges with a
      noise of 10 m, up to 1500 m; 5,000 particles.

    ## Observation

    ``Box(21,)`` float32. It holds what the vehicle knows, never the truth. The estimate is what the
    particle filter reports; its bearing is from the vehicle, relative to the compass heading.

    | index | name | meaning | range |
    |---|---|---|---|
    | 0 | distance | to the estimate / 200 m | 0 to 10 |
    | 1 | log_distance | ln((distance + 1 m) / 60 m) | -3 to 4 |
    | 2 | bearing_cos | of the estimate's bearing relative to the heading | -1 to 1 |
    | 3 | bearing_sin | the same; positive to port | -1 to 1 |
    | 4 | log_spread_along | ln(standard deviation along the line of sight / 20 m) | -4 to 5 |
    | 5 | log_spread_across | the same across it | -4 to 5 |
    | 6 | spread_correlation | between along and across | -1 to 1 |
    | 7 | port_balance | share of particles to port minus share to starboard | -1 to 1 |
    | 8 | silence | ln(1 + time since the last detection / 1 s) / 2 | 0 to 5 |
    | 9 | last_range | last slant range / 200 m; 0 before the first | 0 to 10 |
    | 10 | range_miss | slant range just read minus that to the estimate / 20 m; 0 if none | -8 to 8 |
    | 11 | heard_lately | share of pings heard, average over some 5 pings | 0 to 1 |
    | 12 | heard_long | the same over some 33 pings | 0 to 1 |
    | 13 | velocity_along | of the belief along the line of sight, average over some 20 s / 0.25 m/s | -8 to 8 |
    | 14 | velocity_across | the same across it, positive to the left of the line | -8 to 8 |
    | 15 | bearing_cos_lately | bearing_cos, average over some 200 s | -1 to 1 |
    | 16 | bearing_sin_lately | bearing_sin, average over some 200 s | -1 to 1 |
    | 17 | ping_phase | time since the tag last pinged / its period; -1 before it was heard | -1 to 1 |
    | 18 | heading_cos | of the compass heading | -1 to 1 |
    | 19 | heading_sin | the same | -1 to 1 |
    | 20 | speed | through the water / largest speed | 0 to 1 |

    ## Action, ending, info, seeds, arguments

    As in ``TagTrackEnv``: a course relative to the line from the vehicle to the estimate, at full speed.

    ## Reward

    ``localization``: minus the localization error as a share of 100 m (``masmitja2023``: 300 m), at least -1.

    ## Version history

    * v0: the first version; it may still change before the first release (see CHANGELOG.md).
    """

    default_id: ClassVar[str] = "TagTrack/RangeOnly-v0"
