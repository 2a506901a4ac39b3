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
    masmitja2020_bound,
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
            masmitja2020_bound.BOUND_TWIN,
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
            "Figs. 1, 2, 3, 5 and 6: vehicle, flow of data, geometry, controller, sites.",
            "Fig. 4, calibrations: the curves that are fitted to it (Eqs. 5 and 8) and their sigmas are the receiver's defaults.",
            "Table I: parameters, which are the defaults of the filters and motions.",
            "Table IV, date, time and length of missions: lengths are taken over as they are.",
            "Figs. 7 and 8, paths and courses over time, of which the text tells '10 m' and '2,500 s': the twins draw their own.",
            "Fig. 9, a shark's path and its standard deviations over time: no numbers beside those of Table V.",
        ),
        "lin2013": (
            "Figs. 1 to 3: instruments and geometry.",
            "Figs. 4 and 5, distances over time: their errors are Table III's; the twin draws its own.",
            "Fig. 7, paths of one mission: no numbers.",
            "Fig. 9, two moments of it (errors of 47.6 m, and 2.95 m six minutes later): one event; Alg. 2 has a table.",
            "Fig. 10, errors over distance: every point of what Fig. 11 condenses.",
        ),
        "masmitja2020": (
            "Fig. 1, Figs. 3A, 3F to 3H and S4: methods, instruments, maps. Movies S1 to S4.",
            "Figs. 2B to 2D and S2, errors over noise and time: curves without numbers; `array simulate --paper-path --late 0.1` "
            "draws ours, of the paper's particle filter (`pf_printed`), too.",
            "Fig. 2E, 5 ms a position by WLS, 977 by PF: of the authors' computer and program; `array simulate` tells ours.",
            "Fig. S1, the bound of other arrays: maps without numbers; `array simulate` draws ours.",
            "Fig. 3B, weights over distance: functions, pinned by tests.",
            "Fig. S3, reception over distance ('20 %' at 400 m): the sensor `measured`, from the public detections.",
            "Fig. 4, clocks ('2 ms'): `array sync` on the public part of the data.",
            "Fig. 5 and the lobsters' tracks: `array tracks`; which animal did what rests on data that are not public.",
            "Fig. 6: the positions behind Table S1.",
            "Table 2: other people's campaigns.",
        ),
    }
)
