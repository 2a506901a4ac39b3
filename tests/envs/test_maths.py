"""The polynomials of the inner loop against numpy in float64, over the whole range that each one's docstring promises.

The bounds are those of the docstrings. The grids take float32 numbers by their bits, so that every exponent has its share.
"""

import numba
import numpy as np
import pytest
from scipy import stats

from tagtrack.envs.kernels.maths import fast_asin, fast_exp, fast_log, normal_survival, sin_of_turns

f32 = np.float32


def on_rows(function):
    """The scalar kernel as a loop over an array, which is how the row loops use it."""

    @numba.njit
    def loop(values, results):
        for i in range(values.shape[0]):
            results[i] = function(values[i])

    def of(values):
        values = np.ascontiguousarray(values, f32)
        results = np.empty_like(values)
        loop(values, results)
        return results

    return of


sine = on_rows(sin_of_turns)
logarithm = on_rows(fast_log)
exponential = on_rows(fast_exp)
arcsine = on_rows(fast_asin)
survival = on_rows(normal_survival)


def floats_between(low, high, stride=1):
    """Every float32 from ``low`` to ``high`` (both positive), or every ``stride``-th one, and ``high`` itself."""
    first, last = (int(f32(value).view(np.int32)) for value in (low, high))
    return np.append(np.arange(first, last, stride, dtype=np.int32), np.int32(last)).view(f32)


def both_signs(values):
    return np.concatenate([-values[::-1], [0.0], values]).astype(f32)


def test_sine_of_turns_over_half_a_turn_to_either_side():
    turns = both_signs(floats_between(2.0**-30, 0.5, stride=211))
    error = sine(turns) - np.sin(2.0 * np.pi * turns.astype(np.float64))
    assert np.abs(error).max() < 2e-7


def test_cosine_is_the_sine_of_a_quarter_less_the_turn():
    turns = np.linspace(-0.5, 0.5, 1_000_001, dtype=f32)
    error = sine(f32(0.25) - np.abs(turns)) - np.cos(2.0 * np.pi * turns.astype(np.float64))
    assert np.abs(error).max() < 2e-7


def test_sine_of_turns_keeps_the_digits_of_small_angles():
    turns = both_signs(floats_between(2.0**-100, 0.1, stride=2003))
    exact = np.sin(2.0 * np.pi * turns.astype(np.float64))
    small = np.abs(exact) > 0
    assert np.abs(sine(turns)[small] / exact[small] - 1.0).max() < 2e-7


def test_logarithm_of_every_exponent():
    numbers = floats_between(np.finfo(f32).tiny, np.finfo(f32).max, stride=1009)  # 8,314 numbers to each power of two
    exact = np.log(numbers.astype(np.float64))
    assert np.abs(np.diff(np.log2(numbers.astype(np.float64)))).max() < 2e-4  # the grid leaves no gap
    assert np.all(np.abs(logarithm(numbers) - exact) < 2e-7 * np.maximum(1.0, np.abs(exact)))


def test_logarithm_about_one_where_the_box_muller_radius_is_small():
    numbers = floats_between(0.5, 2.0, stride=7)
    assert np.abs(logarithm(numbers) - np.log(numbers.astype(np.float64))).max() < 2e-7
    assert logarithm(np.ones(1)) == 0.0  # so that no radius is the root of a negative number
    assert logarithm(numbers[numbers < 1.0]).max() <= 0.0


def test_exponential_from_minus_87_to_80():
    # The argument's own rounding, 2^-18 near 64 and beyond, makes the largest errors: those numbers are taken most densely.
    numbers = np.concatenate([-floats_between(2.0**-30, 87.0, stride=499), -floats_between(32.0, 87.0, stride=5)])
    numbers = np.concatenate([numbers, floats_between(2.0**-30, 80.0, stride=499), [0.0]]).astype(f32)
    assert np.abs(exponential(numbers) / np.exp(numbers.astype(np.float64)) - 1.0).max() < 5e-6


def test_exponential_of_a_small_number_has_single_precision():
    numbers = both_signs(floats_between(2.0**-30, 1.0, stride=499))
    assert np.abs(exponential(numbers) / np.exp(numbers.astype(np.float64)) - 1.0).max() < 3e-7


def test_exponential_vanishes_below_its_range():
    # 2^-126, the smallest normal number, stands for zero: beside a weight's floor of 0.001 it is.
    vanished = exponential(np.array([-87.4, -100.0, -1e4, -1e30, -np.inf]))
    assert np.all((vanished >= 0.0) & (vanished < 1.2e-38))


def test_arcsine_from_minus_one_to_one():
    numbers = both_signs(floats_between(2.0**-30, 1.0, stride=211))
    assert np.abs(arcsine(numbers) - np.arcsin(numbers.astype(np.float64))).max() < 2e-6


def test_arcsine_is_steep_but_right_beside_one():
    numbers = both_signs(floats_between(0.999, 1.0))
    assert np.abs(arcsine(numbers) - np.arcsin(numbers.astype(np.float64))).max() < 2e-6


def test_arcsine_of_a_rounded_cosine_beyond_one_is_a_right_angle():
    beyond = np.array([np.nextafter(f32(1.0), f32(2.0)), -np.nextafter(f32(1.0), f32(2.0))], f32)
    np.testing.assert_array_equal(arcsine(beyond), np.array([np.pi / 2, -np.pi / 2], f32))


@pytest.mark.parametrize("function", [sine, exponential, arcsine])
def test_missing_data_stays_missing(function):
    assert np.isnan(function(np.array([np.nan]))).all()


# The same object code has to run whether a kernel was first called from Python or within a step: the linker takes the first
# definition of a symbol that it finds, and two optimizations of one loop may differ in the last bit.
DIGEST = """
import hashlib, sys
import numpy as np
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation

if sys.argv[1] == "kernel first":
    from tagtrack.envs.sensors.stereo import weigh_bearing
    f32, rows = np.float32, np.ones((3, 1000), np.float32)
    weigh_bearing(*rows, f32(0), f32(1), f32(0), f32(1), f32(2), f32(1), f32(0.001))
simulation = Simulation(Scenario(), 8)
simulation.reset(0)
digest = hashlib.sha256()
for _ in range(60):
    simulation.step(np.ones((8, 1, 2)))
    digest.update(simulation.worlds.particles.tobytes() + simulation._workers.scratch[0].weight.tobytes())
print(digest.hexdigest())
"""


def test_numbers_do_not_depend_on_which_kernel_was_called_first(run_python):
    digests = {run_python(DIGEST, order).strip() for order in ("kernel first", "step first")}
    assert len(digests) == 1


@pytest.mark.slow
def test_numbers_do_not_depend_on_whether_the_code_was_compiled_now_or_before(run_python, tmp_path, monkeypatch):
    """The claim that makes the first run of a fresh machine comparable with all later ones."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    compiled_now, from_the_cache = run_python(DIGEST, "step first"), run_python(DIGEST, "step first")
    assert compiled_now == from_the_cache


def test_normal_survival_over_all_that_float32_tells_apart_from_zero_and_one():
    z = np.linspace(-12.0, 12.0, 1_000_001).astype(f32)
    assert np.abs(survival(z) - stats.norm.sf(z.astype(np.float64))).max() < 5e-7
    near_one, near_zero = survival(np.array([-1e4, 1e4], f32))
    assert near_one == 1.0 and 0.0 <= near_zero < 1e-30
