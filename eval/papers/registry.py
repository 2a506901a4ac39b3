"""Which experiments have a twin, by paper, in the order in which they run."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from tagtrack.eval.papers import (
    clark2013_filters,
    clark2013_missions,
    lin2013_clock,
    lin2013_localization,
    lin2013_ranging,
    lin2013_recovery,
    masmitja2020_field,
    masmitja2020_settings,
    masmitja2020_turn,
)
from tagtrack.eval.papers.frame import Experiment

EXPERIMENTS: Mapping[str, tuple[Experiment, ...]] = MappingProxyType(
    {
        "clark2013": (clark2013_missions.PROPORTIONS_TWIN, clark2013_filters.FILTERS_TWIN, clark2013_missions.MISSIONS_TWIN),
        "lin2013": (
            lin2013_clock.HISTOGRAM_TWIN,
            lin2013_clock.PERIODS_TWIN,
            lin2013_clock.DRIFT_TWIN,
            lin2013_ranging.RANGING_TWIN,
            lin2013_localization.LOCALIZATION_TWIN,
            lin2013_recovery.RECOVERY_TWIN,
        ),
        "masmitja2020": (masmitja2020_settings.SETTINGS_TWIN, masmitja2020_turn.TURN_TWIN, masmitja2020_field.FIELD),
    }
)
