"""When acoustic tags ping: at a fixed period, or, lest two tags collide for ever, at random intervals (Vemco)."""

from __future__ import annotations

from dataclasses import dataclass

from tagtrack.envs.validation import require, settle_numbers


@dataclass(frozen=True, kw_only=True)
class Tag:
    """The schedule of a tag, which whoever tracks it knows; when it first pings nobody does."""

    period: float = 2.0  # T_c [s]; the leopard shark's tags had 2 s and 5 s
    random_delay: float = 0.0  # a further wait before each ping, uniform from 0 to this [s]; a Vemco V7: 60 s and up to 30 s
    # How long a transmission lasts [s]: two that overlap at a receiver destroy each other. Some 3 s for a coded tag at 69 kHz.
    burst: float = 0.0

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(self.period > 0, self, "period", "positive")
        require(self.random_delay >= 0, self, "random_delay", "at least 0")
        require(0 <= self.burst < self.period, self, "burst", f"at least 0 and below the period ({self.period} s)")

    @property
    def longest_interval(self) -> float:
        """Any stretch of this length [s] holds a ping for certain."""
        return self.period + self.random_delay
