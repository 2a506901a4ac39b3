"""The Gymnasium environment of area-only tracking. All it adds to ``single.py`` is what its task is."""

from __future__ import annotations

from typing import ClassVar

from tagtrack.envs.single import TagTrackEnv


class AreaOnlyEnv(TagTrackEnv):
    """A vehicle at the surface follows a tag of which it hears only whether it pinged (Masmitja et al. 2020, AOTT).

    The Vemco V7 tag pings every 60 s plus a random delay of up to 30 s. Of the pings from near by a share is received that is
    drawn for each episode from 60 to 100 %; of these 90 % are still heard from 250 m and 20 % from 400 m. A detection says that
    the fish is within range, a silence, where a ping was due for certain, that it may not be: what there is to learn is learned
    at the edge. The filter weighs by Eq. 22 with the softness of this edge in place of the paper's 4.5 and 9 m, and with a
    reception of 80 %; ``overrides={"belief": "aott"}`` brings the paper's own. One step is 30 s, an episode six hours,
    three where the range is unknown.

    * ``TagTrack/AreaOnly-v0``: the filter knows the range of the receiver.
    * ``TagTrack/AreaOnlyUnknownRange-v0``: the range (where half of the pings are heard) is drawn for each episode from 150 to
      400 m, and the filter estimates it together with the position.

    ``overrides={"receiver": "measured"}`` hears as often as was measured at sea, whatever the filter assumes.

    ## Observation

    ``Box(21,)`` float32. It holds what the vehicle knows, never the truth. The estimate is what the
    particle filter reports; its bearing is from the vehicle, relative to the compass heading. A silence counts as a ping
    not heard each time that 90 s have passed, in which one came for certain.

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
    | 9 | max_range | range within which the tag is believed to be heard / 200 m | 0 to 10 |
    | 10 | max_range_spread | its standard deviation / 50 m; 0 where it is assumed | 0 to 4 |
    | 11 | heard_lately | share of pings heard, average over some 5 pings | 0 to 1 |
    | 12 | heard_long | the same over some 33 pings | 0 to 1 |
    | 13 | velocity_along | of the belief along the line of sight, over the last step / 0.25 m/s | -8 to 8 |
    | 14 | velocity_across | the same across it, positive to the left of the line | -8 to 8 |
    | 15 | bearing_cos_lately | bearing_cos, average over some 300 s | -1 to 1 |
    | 16 | bearing_sin_lately | bearing_sin, average over some 300 s | -1 to 1 |
    | 17 | ping_phase | 1 minus the time until the next ping has come for certain / longest interval | 0 to 1 |
    | 18 | heading_cos | of the compass heading | -1 to 1 |
    | 19 | heading_sin | the same | -1 to 1 |
    | 20 | speed | through the water / largest speed | 0 to 1 |

    ## Action, ending, info, seeds, arguments

    As in ``TagTrackEnv``: a course relative to the line from the vehicle to the estimate, at full speed.

    ## Reward

    ``localization``: minus the localization error as a share of 1000 m, at least -1.

    ## Version history

    * v0: the first version; it may still change before the first release (see CHANGELOG.md).
    """

    default_id: ClassVar[str] = "TagTrack/AreaOnly-v0"
