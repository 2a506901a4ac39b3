"""A learned policy for fleets that does not care how many tags and teammates there are, nor in which order they are told.

Teammates enter as a set (their embeddings' mean and largest, Zaheer et al. 2017), and the policy points at tags: each tag
proposes a course relative to the line to its estimate, and attention weighs the proposals (Vinyals et al. 2015). Courses are held
for a number of steps: commitment is what makes sharing out tags learnable. It needs numpy alone, as ``network.py`` does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from tagtrack.policies.network import require_weights

NO_MATE = 4.0  # of the feature mate_log_distance, where a tag's row has it and no teammate is known


class EntityLayout(NamedTuple):
    """Where the features of each entity stand in a flat observation, and what they are called."""

    own: tuple[int, ...]
    tags: tuple[tuple[int, ...], ...]  # (T, F)
    mates: tuple[tuple[int, ...], ...]  # (V - 1, F)
    own_names: tuple[str, ...]
    tag_names: tuple[str, ...]
    mate_names: tuple[str, ...]


OWN_NAMES = frozenset(
    {"heading_cos", "heading_sin", "speed", "battery", "slot_phase", "waiting", "border", "inward_cos", "inward_sin"}
)


def find_entities(names: Sequence[str]) -> EntityLayout:
    """The entities of a layout, told by the names of its features: ``tag_0.distance``, ``mate_1.known``, ``speed``.

    With one tag, its features carry no prefix.

    Raises:
        ValueError: where there is no tag, or tags or teammates are not described alike.
    """
    tags: dict[str, list[tuple[str, int]]] = {}
    mates: dict[str, list[tuple[str, int]]] = {}
    own: list[tuple[str, int]] = []
    for place, name in enumerate(names):
        entity, dot, plain = name.partition(".")
        if dot and entity.startswith("mate_"):
            mates.setdefault(entity, []).append((plain, place))
        elif dot and entity.startswith("tag_"):
            tags.setdefault(entity, []).append((plain, place))
        elif name in OWN_NAMES:
            own.append((name, place))
        else:
            tags.setdefault("", []).append((name, place))
    found = []
    for kind, rows in (("tags", tags), ("teammates", mates)):
        described = {tuple(name for name, _ in row) for row in rows.values()}
        if len(described) > 1 or (kind == "tags" and not described):
            raise ValueError(f"an observation of {len(names)} features has no {kind} that are described alike")
        found.append((tuple(tuple(place for _, place in row) for row in rows.values()), described.pop() if described else ()))
    return EntityLayout(
        own=tuple(place for _, place in own),
        tags=found[0][0],
        mates=found[1][0],
        own_names=tuple(name for name, _ in own),
        tag_names=found[0][1],
        mate_names=found[1][1],
    )


def entity_weight_shapes(*, own: int, tag: int, mate: int, width: int, extras: int) -> dict[str, tuple[int, ...]]:
    """Name and shape of each weight array of the actor; matrices are (inputs, outputs). ``extras``: actions beside the course."""
    sizes = {
        "mate.0": (mate, width),
        "mate.1": (width, width),
        "tag.0": (own + tag + 2 * width, width),
        "tag.1": (width, width),
        "point.0": (3 * width, width),
        "point.1": (width, 3),
        "extra": (2 * width, extras),
    }
    shapes: dict[str, tuple[int, ...]] = {}
    for name, size in sizes.items():
        if size[1] > 0:
            shapes[f"{name}.weight"], shapes[f"{name}.bias"] = size, size[1:]
    shapes["log_std"] = (2 + extras,)
    return shapes


class Held(NamedTuple):
    """What is held of the last decision; each (B,) or (B, E)."""

    left: np.ndarray  # steps for which it is still to be held
    course: np.ndarray  # in the frame of the compass [rad], or relative to the line where courses are
    extras: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class EntityPolicy:
    """The actor of PPO for fleets of any size.

    Raises:
        ValueError: if a field, or a weight's name, shape, type or value, does not fit the others.
    """

    env_id: str  # the environment it was trained on
    observation_features: tuple[str, ...]  # (D,) of the fleet that it steers, in order
    action_names: tuple[str, ...]  # (A,)
    own_names: tuple[str, ...]  # features of the vehicle itself that it reads, as the next two
    tag_names: tuple[str, ...]
    mate_names: tuple[str, ...]
    width: int
    hold: int = 1  # steps between decisions
    courses: str = "auto"  # relative to what the fleet at hand steers: "line", "heading"; auto: the line where there is one tag
    weights: Mapping[str, np.ndarray] = field(repr=False)  # float32, as ``entity_weight_shapes`` says; copied
    seed: int = 0  # of the draws made when not deterministic
    _layout: EntityLayout = field(init=False, repr=False)
    _weights: dict[str, np.ndarray] = field(init=False, repr=False)
    _generator: np.random.Generator = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("width", "hold"):
            value = getattr(self, name)
            if type(value) is not int or value < 1:
                raise ValueError(f"{name} must be a whole number of at least 1, got {value!r}")
        if self.action_names[:2] != ("ahead", "port"):
            raise ValueError(f"action_names must begin with ahead, port, got {self.action_names}")
        shapes = entity_weight_shapes(
            own=len(self.own_names),
            tag=len(self.tag_names),
            mate=len(self.mate_names),
            width=self.width,
            extras=len(self.action_names) - 2,
        )
        require_weights(self.weights, shapes)
        weights = {name: np.array(self.weights[name], order="C") for name in shapes}
        for array in weights.values():
            array.setflags(write=False)
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "_weights", {name: array.astype(np.float64) for name, array in weights.items()})
        object.__setattr__(self, "_layout", self._fit_layout())
        object.__setattr__(self, "_generator", np.random.default_rng(self.seed))
        if self.courses not in ("auto", "heading", "line") or (self.courses == "line" and len(self._layout.tags) > 1):
            raise ValueError(
                f"courses of a fleet's policy are relative to the heading, or with one tag to the line, got {self.courses!r}; "
                "drop steer_by"
            )

    def _fit_layout(self) -> EntityLayout:
        """The layout of the fleet at hand, with the policy's own features of each entity."""
        layout = find_entities(self.observation_features)
        optional = {"mate_log_distance"}  # of a tag, where there are no teammates
        for kind, own, had in (
            ("vehicle", self.own_names, layout.own_names),
            ("tag", self.tag_names, layout.tag_names),
            ("teammate", self.mate_names, layout.mate_names if layout.mates else self.mate_names),
        ):
            missing = [name for name in own if name not in had and name not in optional]
            strange = [name for name in had if name not in own]
            if missing or strange:
                what = f"lacks {missing[0]!r}" if missing else f"has {strange[0]!r}, which the policy does not know"
                raise ValueError(f"it was trained on {self.env_id!r}; here a {kind} {what}: use a policy trained on this task")
        return layout

    @property
    def by_heading(self) -> bool:
        """Whether its courses are relative to the own heading."""
        return self.courses == "heading" or (self.courses == "auto" and len(self._layout.tags) > 1)

    def predict(
        self,
        observation: np.ndarray,
        state: Any = None,
        episode_start: np.ndarray | None = None,
        deterministic: bool = False,
    ) -> tuple[np.ndarray, Held | None]:
        """The mean action, or a draw, of each row; as ``Policy.predict`` says. The state is the decision that is held.

        Raises:
            ValueError: if the observation has another shape, or is NaN or infinite somewhere (the feature is named).
        """
        rows = self._checked_rows(observation)
        heading = self._heading(rows)
        if state is None or episode_start is None:
            begins = np.full(len(rows), state is None)
        else:
            begins = np.broadcast_to(np.asarray(episode_start, bool), len(rows))
        decides = begins | (state.left <= 0) if state is not None else begins
        course = np.zeros(len(rows)) if state is None else state.course.copy()
        extras = np.zeros((len(rows), len(self.action_names) - 2)) if state is None else state.extras.copy()
        left = np.zeros(len(rows), np.int64) if state is None else state.left.copy()
        if decides.any():
            action = self._decide(rows[decides], deterministic)
            course[decides] = np.arctan2(action[:, 1], action[:, 0]) + heading[decides]
            extras[decides] = action[:, 2:]
            left[decides] = self.hold
        held = course - heading
        action = np.column_stack([np.cos(held), np.sin(held), extras]).astype(np.float32)
        return (action[0] if np.ndim(observation) == 1 else action), Held(left - 1, course, extras)

    def _heading(self, rows: np.ndarray) -> np.ndarray:
        """(B,) what courses are held against: the compass, or nothing where they are relative to the line [rad]."""
        if not self.by_heading:
            return np.zeros(len(rows))
        place = dict(zip(self._layout.own_names, self._layout.own, strict=True))
        return np.arctan2(rows[:, place["heading_sin"]], rows[:, place["heading_cos"]])

    def _decide(self, rows: np.ndarray, deterministic: bool) -> np.ndarray:
        """(B, A) actions, before the course is held."""
        mean = self._mean(*self._split(rows))
        if not deterministic:
            mean = mean + np.exp(self._weights["log_std"]) * self._generator.standard_normal(mean.shape)
        return np.clip(mean, -1.0, 1.0)

    def _split(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(B, F) own, (B, T, F) tags and (B, M, F) teammates."""
        layout = self._layout
        by_name = {name: place for name, place in zip(layout.own_names, layout.own, strict=True)}
        own = rows[:, [by_name[name] for name in self.own_names]]
        tags = np.stack([self._entity(rows, places, layout.tag_names, self.tag_names) for places in layout.tags], axis=1)
        mates = np.zeros((len(rows), 0, len(self.mate_names)))
        if layout.mates:
            mates = np.stack([self._entity(rows, places, layout.mate_names, self.mate_names) for places in layout.mates], axis=1)
        return own, tags, mates

    @staticmethod
    def _entity(rows: np.ndarray, places: Sequence[int], had: Sequence[str], wanted: Sequence[str]) -> np.ndarray:
        by_name = dict(zip(had, places, strict=True))
        missing = np.full(len(rows), NO_MATE)
        return np.stack([rows[:, by_name[name]] if name in by_name else missing for name in wanted], axis=1)

    def _mean(self, own: np.ndarray, tags: np.ndarray, mates: np.ndarray) -> np.ndarray:
        """(B, A) mean of the Gaussian; the twin of ``train.entity_network.EntityActor.forward``."""
        count = tags.shape[1]
        team = self._team(mates)
        context = np.concatenate([own, team], axis=1)[:, np.newaxis].repeat(count, axis=1)
        embedded = self._layer("tag.1", self._layer("tag.0", np.concatenate([tags, context], axis=2)))
        all_tags = np.concatenate([embedded.mean(axis=1), embedded.max(axis=1)], axis=1)
        beside = all_tags[:, np.newaxis].repeat(count, axis=1)
        proposed = self._linear("point.1", self._layer("point.0", np.concatenate([embedded, beside], axis=2)))
        weight = np.exp(proposed[..., 0] - proposed[..., 0].max(axis=1, keepdims=True))
        weight /= weight.sum(axis=1, keepdims=True)
        ahead, port = proposed[..., 1], proposed[..., 2]
        if self.by_heading:
            cos, sin = tags[..., self.tag_names.index("bearing_cos")], tags[..., self.tag_names.index("bearing_sin")]
            ahead, port = ahead * cos - port * sin, ahead * sin + port * cos
        course = np.stack([(weight * ahead).sum(axis=1), (weight * port).sum(axis=1)], axis=1)
        if len(self.action_names) == 2:
            return course
        return np.concatenate([course, self._linear("extra", all_tags)], axis=1)

    def _team(self, mates: np.ndarray) -> np.ndarray:
        """(B, 2 W) mean and largest embedding of the teammates that are known; 0 where none is."""
        if mates.shape[1] == 0 or not self.mate_names:
            return np.zeros((len(mates), 2 * self.width))
        known = mates[..., :1] > 0.5
        embedded = self._layer("mate.1", self._layer("mate.0", mates)) * known
        return np.concatenate([embedded.sum(axis=1) / np.maximum(known.sum(axis=1), 1), embedded.max(axis=1)], axis=1)

    def _linear(self, name: str, inputs: np.ndarray) -> np.ndarray:
        return inputs @ self._weights[f"{name}.weight"] + self._weights[f"{name}.bias"]

    def _layer(self, name: str, inputs: np.ndarray) -> np.ndarray:
        return np.maximum(self._linear(name, inputs), 0.0)

    def _checked_rows(self, observation: np.ndarray) -> np.ndarray:
        rows = np.asarray(observation, dtype=np.float64)
        features = len(self.observation_features)
        if rows.ndim not in (1, 2) or rows.shape[-1] != features:
            raise ValueError(f"observation has shape {rows.shape}, but the policy takes (B, {features}) or ({features},)")
        rows = np.atleast_2d(rows)
        if not np.isfinite(rows).all():
            row, feature = (int(index) for index in np.argwhere(~np.isfinite(rows))[0])
            name = self.observation_features[feature]
            raise ValueError(f"observation feature {feature} ({name!r}) of row {row} is {rows[row, feature]}: it must be finite")
        return rows
