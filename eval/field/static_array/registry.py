"""The estimators by the names that command lines and tables write."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Protocol, cast

import numpy as np
from numpy.typing import ArrayLike

from tagtrack.envs.model import import_object
from tagtrack.eval.field.static_array.arrival_track import yaps
from tagtrack.eval.field.static_array.closed_form import weighted_least_squares
from tagtrack.eval.field.static_array.likelihood import check_pings
from tagtrack.eval.field.static_array.map_track import maximum_a_posteriori
from tagtrack.eval.field.static_array.map_window import map_marginal
from tagtrack.eval.field.static_array.maximum_likelihood import maximum_likelihood, wls_ml
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings, Positions, level_places
from tagtrack.eval.field.static_array.particle_track import particle_filter


class Estimator(Protocol):
    """Positions of K pings, from the arrivals at receivers (R, n) [m] and, where given, their information (K, R, R) [1/s^2].

    Where the pings tell the tag's height, receivers are (R, 3) and positions (K, 2).
    """

    def __call__(
        self, pings: Pings, receivers: ArrayLike, setting: ArraySetting, *, information: Floats | None = None
    ) -> Positions: ...


METHODS: Mapping[str, Estimator] = MappingProxyType(
    {
        "wls": weighted_least_squares,
        "ml": maximum_likelihood,
        "wls_ml": wls_ml,
        "map": maximum_a_posteriori,
        "map_m": map_marginal,
        "pf": particle_filter,
        "yaps": yaps,
    }
)


SMOOTHING = ("map", "map_m", "pf", "yaps")  # that look at the whole track
TRACKERS = {"map": maximum_a_posteriori, "map_m": map_marginal}  # that may weigh by agreement with the track, too


def find_estimator(name: str) -> str | Estimator:
    """A name of ``METHODS`` as it is, or the function that ``MODULE:FUNCTION`` names.

    Raises:
        ValueError: for a name that is neither, or a module or function that is not there.
    """
    if name in METHODS:
        return name
    if ":" not in name:
        raise ValueError(f"unknown --method {name}; known: {', '.join(METHODS)}, or MODULE:FUNCTION of your own")
    estimator = import_object(name)
    if not callable(estimator):
        raise ValueError(f"--method {name} must be a function (pings, receivers, setting, *, information), got {estimator!r}")
    return cast("Estimator", estimator)


def locate(
    method: str | Estimator,
    pings: Pings,
    receivers: ArrayLike,
    setting: ArraySetting,
    *,
    information: Floats | None = None,
    robust: bool = False,
) -> Positions:
    """Positions of K pings by a method of ``METHODS`` or an estimator of one's own; none for no pings.

    Args:
        robust: let the track of ``map`` and ``map_m`` weigh arrivals that disagree with it less.

    Raises:
        ValueError: for an unknown method, listing those there are, receivers that are not (R, 2) or (R, 3), arrivals that are not
            (K, R), or times that are not one for each ping, finite and in order.
    """
    places, _ = level_places(pings, receivers)
    if not isinstance(method, str):
        check_pings(pings, places)
        return _checked(method(pings, receivers, setting, information=information), method, len(pings.time), places.shape[1])
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}; known: {', '.join(METHODS)}")
    check_pings(pings, places)
    if robust and method in TRACKERS:
        return TRACKERS[method](pings, receivers, setting, information=information, robust=True)
    return METHODS[method](pings, receivers, setting, information=information)


def _checked(found: Positions, method: Estimator, count: int, dimensions: int) -> Positions:
    """What an estimator of the user's own returned, if it has the shapes (K, n) and (K, n, n)."""
    name = getattr(method, "__name__", repr(method))
    if not isinstance(found, Positions):
        raise ValueError(f"{name} must return Positions(position=..., covariance=...), got {type(found).__name__}")
    for field, shape in (("position", (count, dimensions)), ("covariance", (count, dimensions, dimensions))):
        if np.shape(getattr(found, field)) != shape:
            raise ValueError(f"{name}: {field} must be {shape}, got shape {np.shape(getattr(found, field))}")
    return found
