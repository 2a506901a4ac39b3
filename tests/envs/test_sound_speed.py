"""Speed of sound in sea water."""

import numpy as np
import pytest

from tagtrack.envs.sim.sound_speed import sound_speed


def test_check_value_that_mackenzie_prints():
    assert sound_speed(25.0, 35.0, 1000.0) == pytest.approx(1550.744, abs=0.0005)


def test_it_rises_with_temperature_salinity_and_depth():
    assert sound_speed(10.0, 35.0, 10.0) < sound_speed(11.0, 35.0, 10.0)
    assert sound_speed(10.0, 35.0, 10.0) < sound_speed(10.0, 36.0, 10.0)
    assert sound_speed(10.0, 35.0, 10.0) < sound_speed(10.0, 35.0, 20.0)


def test_arrays_broadcast_and_nan_stays_nan():
    speeds = sound_speed([[10.0], [20.0]], 35.0, [0.0, np.nan, 100.0])
    assert speeds.shape == (2, 3)
    assert np.isnan(speeds[:, 1]).all()
    assert speeds[1, 2] == sound_speed(20.0, 35.0, 100.0)


@pytest.mark.parametrize(
    ("water", "complaint"),
    [
        ((1.0, 35.0, 0.0), "temperature must be within 2 to 30 degrees Celsius, got 1;"),
        ((15.0, [35.0, 5.0], 0.0), "salinity must be within 25 to 40 parts per thousand, got 5;"),
        ((15.0, 35.0, -3.0), "depth must be within 0 to 8000 m, got -3;"),
    ],
)
def test_water_beyond_the_formula_is_refused(water, complaint):
    with pytest.raises(ValueError, match=complaint):
        sound_speed(*water)
