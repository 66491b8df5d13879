"""What the robot would do: features, learner and action filter joined into one policy."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from robot.driver import Move
from robot.learner import votes
from robot.learner.base import (
    ContextualLearner,
    Evidence,
    Learner,
    NotFittedError,
    State,
    Vector,
)
from robot.policy.action_filter import ActionFilter, View
from robot.policy.calibration import Calibration
from robot.policy.example_rate import ExampleRate
from robot.policy.features import Features
from robot.policy.gallery import Gallery, LearnedImage
from robot.policy.light import LightAdaptation
from robot.policy.move_context import MoveContext
from robot.policy.move_kinds import MoveKinds
from robot.policy.pilot_pace import PilotPace
from robot.policy.running_votes import USUAL_STEP_S
from robot.types import DEFAULT_MOVES, Action, Frame, Prediction

_DOUBT = 0.5
"""How fast confidence falls with novelty beyond 1: at 3 half of it is left."""
_LEAST = 1e-6
"""Votes for a move that was taught: more than for one that never was."""


class Policy:
    """Proposes an action for each frame, and learns from examples.

    Not thread-safe: only the control loop's thread may use it.

    Args:
        name: Its name, such as `default-32`.
        max_nodes: How many images its learner keeps at most.
        learner: Learns and recognises.
        features: From frame to vector.
        moves: What it may propose.
        action_filter: Makes what makes a steady drive of the votes on single frames.
        calibrates: Learn from the examples how sure it may be here (`calibration.py`).
        brighten: Returns a view with its grey values multiplied; with it the learner is shown each
            view in the light that it was taught in (`light.py`).

    Attributes:
        kinds: Which of the moves are turns, and which drive straight.
    """

    def __init__(
        self,
        name: str,
        max_nodes: int,
        learner: Learner,
        features: Features,
        *,
        moves: tuple[Action, ...] = DEFAULT_MOVES,
        action_filter: Callable[[MoveKinds], ActionFilter] = ActionFilter,
        calibrates: bool = False,
        brighten: Callable[[Vector, float], Vector] | None = None,
    ) -> None:
        self.name = name
        self.max_nodes = max_nodes
        self.moves = moves
        self.learner = learner
        self.features = features
        self.kinds = MoveKinds(moves)
        self._action_filter = action_filter(self.kinds)
        self._n_examples = 0
        self._n_proposals = 0
        self._pace = PilotPace(self.kinds)
        self._calibration = Calibration() if calibrates else None
        self._brighten = brighten
        self._light = LightAdaptation()
        self._contextual: ContextualLearner | None = None
        if learner.abilities.contexts and isinstance(learner, ContextualLearner):
            self._contextual = learner
        self._context = MoveContext(self.kinds)
        self._rate = ExampleRate()
        self._now_s = 0.0
        self._gallery = Gallery(learner, features)

    def describe_moves(self, declared: Iterable[Move]) -> None:
        """Take in what a body says of its moves: which are turns, which drive straight."""
        self.kinds.describe(declared)

    @property
    def n_nodes(self) -> int:
        """How many learned images there are; 0 for learners that keep none."""
        return self.learner.n_nodes_

    @property
    def n_seen(self) -> int:
        """How many examples were learned."""
        return self._n_examples

    def extract(self, frame: Frame) -> Vector:
        """Return the frame's vector; pure. Raises CameraError for bytes that are not an image."""
        return self.features.extract(frame)

    def propose(
        self,
        frame_id: int,
        x: Vector,
        *,
        under_way: Action | None = None,
        at_s: float | None = None,
        bumped: bool = False,
    ) -> Prediction:
        """Return what to do on this frame. Call it once for each frame, in order.

        Before the first example the action is None and there are no probabilities.

        Args:
            frame_id: The frame.
            x: Its vector.
            under_way: The move that the robot is making by its own choice, if it drives.
            at_s: When the frame was taken; None: a tenth of a second after the one before.
            bumped: True if a bumper is pressed.
        """
        self._n_proposals += 1
        try:
            evidence = self._explain(self._in_taught_light(x, at_s), under_way)
        except NotFittedError:
            return Prediction(frame_id=frame_id, action=None, confidence=0.0, probabilities={})
        known = evidence.probabilities
        shares = {move: max(known[move], _LEAST) if move in known else 0.0 for move in self.moves}
        steady = self._action_filter.average(shares, at_s, self._pace.usual_run_s)
        self._now_s = self._now_s + USUAL_STEP_S if at_s is None else at_s
        view = View(picture=self.features.grey(x), at_s=self._now_s, bumped=bumped)
        action = self._action_filter.choose(
            steady, view, under_way, self._pace, in_context=self._contextual is not None
        )
        self._gallery.note_used(evidence.node, self._n_proposals)
        return Prediction(
            frame_id=frame_id,
            action=action,
            confidence=self._chance(steady, action, evidence.novelty),
            probabilities=steady,
            node=evidence.node,
            distance=evidence.distance,
            novelty=evidence.novelty,
            is_stalled=self._action_filter.is_stalled,
            is_turn=action in self.kinds.turns,
            needs_help=self._action_filter.needs_help,
        )

    def _explain(self, x: Vector, under_way: Action | None) -> Evidence:
        if self._contextual is None:
            return self.learner.explain_one(x)
        context = None if under_way is None else self._context.of(under_way)
        return self._contextual.explain_in(x, context)

    def _in_taught_light(self, x: Vector, at_s: float | None) -> Vector:
        if self._brighten is None:
            return x
        gain = self._light.gain(float(self.features.grey(x).mean()), at_s)
        return x if gain == 1.0 else self._brighten(x, gain)

    def learn(self, x: Vector, label: Action, at_s: float | None = None) -> None:
        """Learn one example.

        Given times, at most ten examples a second are learned while the label stays the same; the
        others are counted (`example_rate.py`).

        Args:
            x: The frame's vector.
            label: The move.
            at_s: The frame's teaching time; None: it stands for itself.

        Raises:
            ValueError: If the label is none of `moves`, or `x` cannot be learned; nothing changes.
        """
        if label not in self.moves:
            raise ValueError(f"{label!r} is not one of the moves {', '.join(self.moves)}")
        label = Action(label)
        if self._rate.admits(label, at_s):
            self._calibrate(x, label, at_s)
            if self._contextual is None:
                self.learner.learn_one(x, label)
            else:
                self._contextual.learn_in(x, label, self._context.note(label, at_s))
            if self._brighten is not None:
                self._light.learn(float(self.features.grey(x).mean()))
        if at_s is not None:
            self._pace.learn(label, self.features.grey(x), at_s)
        self._n_examples += 1
        self._gallery.note_taught(self.learner.last_node_, self._n_examples)

    def _calibrate(self, x: Vector, label: Action, at_s: float | None) -> None:
        def predict() -> Mapping[str, float]:
            return self.learner.predict_proba_one(x) if self.learner.n_nodes_ else {}

        if self._calibration is not None:
            self._calibration.note(label, at_s, predict)

    def reset(self) -> None:
        """Forget what belongs to one drive: a new drive begins."""
        self._action_filter.reset()
        self.learner.reset()
        self._light.reset()

    def get_state(self) -> State:
        """Return a copy of all that was learned, without what belongs to one drive."""
        state = self.learner.get_state()
        params = {
            "learner": state.params,
            "lessons": self._n_examples,
            "last_taught": self._gallery.get_state(),
            "name": self.name,
            "last_learned": self._rate.get_state(),
        }
        if self._calibration is not None:
            params["calibration"] = self._calibration.get_state()
        if self._brighten is not None:
            params["light"] = self._light.get_state()
        if self._contextual is not None:
            params["context"] = self._context.get_state()
        params["kinds"] = self.kinds.get_state()
        params["pace"], pace_arrays = self._pace.get_state()
        arrays = {**state.arrays, **pace_arrays}
        return State(kind=f"policy:{state.kind}", params=params, arrays=arrays, labels=state.labels)

    def set_state(self, state: State) -> None:
        """Restore `state`, at the beginning of a drive.

        Raises:
            ValueError: If it is of another kind.
        """
        self.restore(state)
        self.learner.reset()

    def restore(self, state: State) -> None:
        """Restore `state` in the middle of a drive: the same predictions and future learning.

        Raises:
            ValueError: If it is of another kind.
        """
        kind, params = state.kind.removeprefix("policy:"), state.params["learner"]
        self.learner.set_state(replace(state, kind=kind, params=params))
        self._n_examples = int(state.params["lessons"])
        self._rate.set_state(state.params.get("last_learned"))
        if "kinds" in state.params:  # else the moves are as they were described
            self.kinds.set_state(state.params["kinds"])
        self._pace = PilotPace(self.kinds)
        if "pace" in state.params:  # models of version 0.1 have none
            self._pace.set_state(state.params["pace"], state.arrays)
        if self._calibration is not None:
            self._calibration = Calibration()
            if "calibration" in state.params:  # older models have none
                self._calibration.set_state(state.params["calibration"])
        self._light = LightAdaptation()
        if self._brighten is not None and "light" in state.params:
            self._light.set_state(state.params["light"])
        self._context = MoveContext(self.kinds)
        if self._contextual is not None and "context" in state.params:
            self._context.set_state(state.params["context"])
        self._n_proposals = 0
        self._gallery.set_state(state.params["last_taught"])
        self._action_filter.reset()

    def gallery(self) -> list[LearnedImage]:
        """Return every learned image, in the order of the nodes; none if the learner keeps none."""
        return self._gallery.images()

    def relabel_node(self, node_id: int, label: Action) -> None:
        """Let one learned image vote for `label` alone.

        Raises:
            LookupError: If there is no such node.
            ValueError: If `label` is none of `moves`.
        """
        if label not in self.moves:
            raise ValueError(f"{label!r} is not one of the moves {', '.join(self.moves)}")
        self.learner.relabel_node(node_id, Action(label))

    def delete_node(self, node_id: int) -> None:
        """Forget one learned image; raises LookupError if there is none."""
        self.learner.delete_node(node_id)

    def pin_node(self, node_id: int, pinned: bool = True) -> None:
        """Keep one learned image from merging; raises LookupError if there is none."""
        self.learner.pin_node(node_id, pinned)

    def _chance(self, shares: dict[Action, float], action: Action, novelty: float) -> float:
        """Return how likely the action is right; near a guess on an unknown view."""
        values = list(shares.values())
        factor = self._calibration.factor if self._calibration is not None else 1.0
        power = factor * self.learner.sharpness
        chance = votes.chance(values, list(shares).index(action), power)
        if novelty <= 1.0:
            return chance
        guess = 1.0 / sum(share > 0.0 for share in shares.values())
        return guess + (chance - guess) / (1.0 + _DOUBT * (novelty - 1.0))
