"""What vehicles tell one another: packets of their own pose and of measurements, and what a teammate is known by.

Nothing in here is true: a packet tells what its sender believes and has measured, and a teammate is where it last said it was.
"""

from __future__ import annotations

import numpy as np

# The head of a packet: sent when [s], the sender's navigation then [m, rad, m/s], how many measurements follow.
PACKET = np.dtype([(name, np.float64) for name in ("time", "x", "y", "heading", "speed")] + [("count", np.int64)])

# What a vehicle knows of a teammate: whether anything, and where it was at `time` [s], as it believed itself.
MATE = np.dtype([("known", np.bool_)] + [(name, np.float64) for name in ("time", "x", "y", "heading", "speed")])

# A vehicle's modem as its own computer sees it: whether it is to send in its next slot, measurements `waiting` to be sent (with
# all before the first slot), where its next packet will be kept; messages `sent` and `received` in the episode, how many of them
# in this step, and measurements that came `too_late` to be remembered.
RADIO = np.dtype(
    [("wants", np.bool_)]
    + [(name, np.int64) for name in ("waiting", "next", "sent", "sent_now", "received", "too_late")]
)
