"""The Gymnasium environment of bearing and time of flight. All it adds to ``single.py`` is what its task is."""

from __future__ import annotations

from typing import ClassVar

from tagtrack.envs.single import TagTrackEnv


class TimeOfFlightEnv(TagTrackEnv):
    """An AUV with a stereo hydrophone that knows the clock of the tag: bearing and range from one ping (Lin et al. 2013).

    The tag pings every 2 s. Of a ping that both hydrophones hear, the vehicle reads the coarse bearing without side of
    ``TagTrackEnv`` and, because it knows when the ping was sent, a range good to some metres (Eqs. 5-7). Both clocks have
    drifted since the tag was calibrated, and one code in 400 is read as its neighbour and puts the fish 73 m too far. The
    filter drops ranges that jump by more than 50 m (Alg. 1), weighs by bearing and range together (Eq. 8), and scatters
    particles at random when readings fit worse than they used to (Alg. 2). Losses come in bursts, as in LeopardShark. One step
    is 2 s, an episode 10 minutes; it begins up to 85 m from the fish.

    * ``TagTrack/TimeOfFlight-v0``: keep the localization error low.

    Worth changing (``overrides``): ``receiver.hours_since_calibration`` (4), after which the clocks are off by 5.8 m root mean
    square at 22 h, drawn for each episode; ``belief.receiver.measurements`` (``both``, ``angle``, ``distance``: Table IV);
    ``belief.recovery.second_resampling`` (``with_random``, ``never``, ``as_printed``: lines 9-16 of Alg. 2).

    ## Observation

    ``Box(21,)`` float32. It holds what the vehicle knows, never the truth. The estimate is what the
    particle filter reports; its bearing is from the vehicle, relative to the compass heading.

    | index | name | meaning | range |
    |---|---|---|---|
    | 0 | distance | to the estimate / 50 m | 0 to 10 |
    | 1 | log_distance | ln((distance + 1 m) / 15 m) | -3 to 4 |
    | 2 | bearing_cos | of the estimate's bearing relative to the heading | -1 to 1 |
    | 3 | bearing_sin | the same; positive to port | -1 to 1 |
    | 4 | log_spread_along | ln(standard deviation along the line of sight / 5 m) | -4 to 5 |
    | 5 | log_spread_across | the same across it | -4 to 5 |
    | 6 | spread_correlation | between along and across | -1 to 1 |
    | 7 | port_balance | share of particles to port minus share to starboard | -1 to 1 |
    | 8 | silence | ln(1 + time since the last detection / 1 s) / 2 | 0 to 5 |
    | 9 | last_units | last bearing reading / 9 Lotek units; 0 before the first | -1 to 1 |
    | 10 | last_range | last time-of-flight range / 50 m; 0 before the first | -1 to 10 |
    | 11 | heard_lately | share of pings heard, average over some 5 pings | 0 to 1 |
    | 12 | heard_long | the same over some 33 pings | 0 to 1 |
    | 13 | velocity_along | of the belief along the line of sight, average over some 20 s / 0.25 m/s | -8 to 8 |
    | 14 | velocity_across | the same across it, positive to the left of the line | -8 to 8 |
    | 15 | bearing_cos_lately | bearing_cos, average over some 20 s | -1 to 1 |
    | 16 | bearing_sin_lately | bearing_sin, average over some 20 s | -1 to 1 |
    | 17 | ping_phase | time since the tag last pinged / its period; -1 before it was heard | -1 to 1 |
    | 18 | heading_cos | of the compass heading | -1 to 1 |
    | 19 | heading_sin | the same | -1 to 1 |
    | 20 | speed | through the water / largest speed | 0 to 1 |

    ## Action, ending, info, seeds, arguments

    As in ``TagTrackEnv``: a course relative to the line from the vehicle to the estimate, at full speed.

    ## Reward

    ``localization``: minus the localization error as a share of 100 m, at least -1.

    ## Version history

    * v0: the first version; it may still change before the first release (see CHANGELOG.md).
    """

    default_id: ClassVar[str] = "TagTrack/TimeOfFlight-v0"
