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
    masmitja2020_float,
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
        "masmitja2020": (
            masmitja2020_settings.SETTINGS_TWIN,
            masmitja2020_turn.TURN_TWIN,
            masmitja2020_float.FLOAT_TWIN,
            masmitja2020_field.FIELD,
        ),
    }
)

# What the papers print or draw and no table of ours repeats, and why.
WITHOUT_TWIN: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "clark2013": (
            "Table I: parameters, which are the defaults of the filters and motions.",
            "Table IV, lengths of missions: taken over as they are.",
            "Fig. 9, a shark's path and its standard deviations over time: no numbers beside those of Table V.",
        ),
        "lin2013": (
            "Figs. 1 to 3: instruments and geometry.",
            "Figs. 7 and 9, paths of one mission: no numbers but the 47.6 m of one snapshot; Alg. 2 has a table of its own.",
        ),
        "masmitja2020": (
            "Figs. 2A to 2D and S2, errors over noise and time: curves without numbers; `array simulate` draws ours.",
            "Fig. 2E, milliseconds a position: of the authors' computer.",
            "Fig. 4, clocks: `array sync` on the public part of the data.",
            "Fig. 5 and home ranges, the lobsters: `array tracks`; which animal did what rests on data that are not public.",
            "Table 2: other people's campaigns.",
            "Fig. S3, reception over distance: the sensor `measured`, from the public detections.",
        ),
    }
)
