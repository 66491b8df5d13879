"""The robot's policy, which combines features, learner and action filter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from robot.learner import votes
from robot.learner.base import Learner, NotFittedError, State, Vector, checked_vector
from robot.learner.part import Stateful, Value
from robot.learner.values import count, flag
from robot.policy.action_filter import ActionFilter
from robot.policy.example_selection import ExampleRate, MoveContext, Repeats
from robot.policy.features import Features
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import USUAL_STEP_S, PolicyPart, Seen, TaughtExample
from robot.policy.recognition import Degrees, LightAdaptation, Recognition
from robot.types import DEFAULT_MOVES, Action, Frame, Point, Prediction


class Policy(Stateful):
    """Proposes an action for each frame, and learns from examples.

    A policy is a list of parts (`part.py`). Each frame and each example passes through all parts in
    a fixed order, and the declared state of each part is saved, loaded and checked. Only the
    control loop's thread may use a policy. `changes.py` makes the other changes of a policy.

    Args:
        name: The policy's name, such as `default-32`.
        max_nodes: Maximum number of images of the learner.
        learner: Learns and recognises views.
        features: Converts a frame to a vector.
        moves: The moves that the policy may propose.
        action_filter: Makes the filter that turns the votes on single frames into steady driving.
        thins: True if at most ten examples of the same label are learned per second
            (`example_selection.py`).
        brighten: Multiplies a view's grey values by a factor, for `LightAdaptation`; if None, views
            are not scaled to the brightness of the examples.
        knows_repeats: True to skip views that were already learned with the same label.

    Attributes:
        kinds: The kinds of the moves (turns and straight moves); `describe` sets the kinds of a
            body's declared moves.
        n_seen: Number of learned examples.
        alike: True if the pilot says that left and right are alike here (`changes.set_alike`).
        recognition: The part that records when each learned image was last matched.
    """

    fields = (
        Value("name", lambda plain, names: str(plain), "name", is_fixed=True),
        Value("lessons", count(), "n_seen"),
        Value("alike", flag, "alike"),
    )

    def __init__(
        self,
        name: str,
        max_nodes: int,
        learner: Learner,
        features: Features,
        *,
        moves: tuple[Action, ...] = DEFAULT_MOVES,
        action_filter: Callable[[MoveKinds], ActionFilter] = ActionFilter,
        thins: bool = True,
        brighten: Callable[[Vector, float], Vector] | None = None,
        knows_repeats: bool = False,
    ) -> None:
        self.name = name
        self.max_nodes = max_nodes
        self.moves = moves
        self.learner = learner
        self.features = features
        self.kinds = MoveKinds(moves)
        self.n_seen = 0
        self.alike = False
        self._n_proposals = 0
        self._n_values: int | None = None
        self._now_s = 0.0
        self._last_s: float | None = None
        self._smoothing = smoothing = action_filter(self.kinds)
        self._degrees = degrees = Degrees(learner, moves, self.kinds)
        self.recognition = recognition = Recognition(learner, moves, degrees)
        parts: list[tuple[str, PolicyPart]] = [("", ExampleRate())] if thins else []
        if learner.abilities.contexts:
            parts.append(("context", MoveContext(self.kinds)))
        if knows_repeats:
            parts.append(("", Repeats(moves)))
        if brighten is not None:
            parts.append(("light", LightAdaptation(brighten)))
        parts += [("", recognition), ("pace", smoothing.pace)]
        parts += [("", smoothing), ("degrees", degrees)]
        self._parts = parts
        self._seeing, self._learning = (
            [part for _, part in parts if getattr(type(part), of) is not getattr(PolicyPart, of)]
            for of in ("on_frame", "on_example")
        )

    @property
    def n_nodes(self) -> int:
        """Number of learned images; 0 for learners without images."""
        return self.learner.n_nodes_

    def usual_point(self, move: Action) -> Point | None:
        """Return a move's usual steering and throttle; None if no example of it has them."""
        return self._degrees.usual(move)

    def extract(self, frame: Frame) -> Vector:
        """Return the frame's vector. Raises CameraError if the frame's bytes are not an image."""
        return self.features.extract(frame)

    def propose(
        self,
        frame_id: int,
        x: Vector,
        *,
        under_way: Action | None = None,
        at_s: float | None = None,
        bumped: bool = False,
        takes_points: bool = True,
    ) -> Prediction:
        """Return the prediction for this frame. The caller must pass each frame once, in order.

        Before the first example the action is None and there are no probabilities.

        Args:
            frame_id: The frame's id.
            x: The frame's vector.
            under_way: The robot's current move if it drives itself, else None.
            at_s: The time at which the frame was taken; if None, a tenth of a second after the
                previous frame.
            bumped: True if a bumper is pressed.
            takes_points: True if the body accepts points; if False, no point is proposed.

        Raises:
            Exception: If the learner fails; the next frame may succeed.
        """
        self._n_proposals += 1
        last_s, self._last_s = self._last_s, at_s
        step_s = USUAL_STEP_S if at_s is None or last_s is None else max(at_s - last_s, 0.0)
        self._now_s = self._now_s + USUAL_STEP_S if at_s is None else at_s
        seen = Seen(
            number=self._n_proposals,
            x=x,
            picture=self.features.grey(x),
            at_s=self._now_s,
            step_s=step_s,
            under_way=under_way,
            bumped=bumped,
            takes_points=takes_points,
        )
        try:
            for part in self._seeing:
                part.on_frame(seen)
        except NotFittedError:
            return Prediction(frame_id=frame_id)
        known = seen.evidence
        listed, best = list(seen.shares.values()), list(seen.shares).index(seen.action)
        confidence = votes.doubted(listed, best, self.learner.sharpness, known.novelty)
        if not math.isfinite(confidence):
            raise ValueError("the learner's result for this picture contains NaN or infinity")
        return Prediction(
            frame_id=frame_id,
            action=seen.action,
            confidence=confidence,
            probabilities=seen.shares,
            node=known.node,
            distance=known.distance,
            novelty=known.novelty,
            is_stalled=seen.is_stalled,
            is_turn=seen.action in self.kinds.turns,
            needs_help=seen.needs_help,
            point=seen.point,
            spread=seen.spread,
        )

    def learn(
        self, x: Vector, label: Action, at_s: float | None = None, point: Point | None = None
    ) -> None:
        """Learn one example; arguments and errors as for `learn_all`."""
        self.learn_all([(x, label, at_s, point)])

    def learn_all(
        self, examples: Sequence[tuple[Vector, Action, float | None, Point | None]]
    ) -> None:
        """Learn examples in order, with the same result as one call for each example.

        If the examples have times, the policy learns at most ten per second while the label stays
        the same, and only counts the others (`example_selection.py`).

        Args:
            examples: Tuples of a frame's vector, the move, the teaching time in seconds, and the
                point or None. An example without a time is learned independently of earlier
                examples. Examples with a point were steered proportionally.

        Raises:
            ValueError: If a label is not one of `moves`, a value of a point is not from -1 to 1, or
                a vector cannot be learned. If a single example fails, nothing has changed.
        """
        n_values = self._n_values
        for x, label, _, point in examples:  # check before any part is changed
            self.check_move(label)
            if len(x) != n_values:
                n_values = checked_vector(x, n_values).size
            if point is not None and not all(-1.0 <= share <= 1.0 for share in point):
                raise ValueError(f"steering and throttle must lie in [-1, 1], not {tuple(point)}")
        lessons = [
            TaughtExample(
                number=number,
                x=x,
                picture=self.features.grey(x),
                label=label if isinstance(label, Action) else Action(label),
                at_s=at_s,
                point=point,
            )
            for number, (x, label, at_s, point) in enumerate(examples, self.n_seen + 1)
        ]
        for part in self._learning:
            for lesson in lessons:
                if lesson.is_learned or part.counts_all:
                    part.on_example(lesson)
        self.n_seen, self._n_values = self.n_seen + len(lessons), n_values

    def check_move(self, label: Action) -> None:
        """Raise ValueError if a label is not one of `moves`."""
        if label not in self.moves:
            raise ValueError(f"{label!r} is not one of the moves {', '.join(self.moves)}")

    def reset(self) -> None:
        """Forget the state of the last drive, because a new drive begins."""
        for _, part in self._parts:
            part.reset()
        self._last_s = None

    def parts(self) -> Sequence[tuple[str, Stateful]]:
        return [("kinds", self.kinds), *self._parts]

    def get_state(self) -> State:
        """Return a copy of the learned state, without the state of the current drive."""
        state, (params, arrays) = self.learner.get_state(), self.save()
        return State(
            kind=f"policy:{state.kind}",
            params={**params, "learner": state.params},
            arrays={**arrays, **state.arrays},
            labels=state.labels,
        )

    def set_state(self, state: State) -> None:
        """Restore `state`, at the beginning of a drive.

        Raises:
            ValueError: If `state` comes from another kind of policy.
        """
        self.restore(state)
        self.learner.reset()

    def restore(self, state: State) -> None:
        """Restore a `state` from the middle of a drive. The policy then predicts and learns as if
        the drive had not been interrupted.

        Raises:
            ValueError: If `state` comes from another kind of policy.
        """
        params = dict(state.params)
        kind, own = state.kind.removeprefix("policy:"), self.array_names() & state.arrays.keys()
        theirs = {key: array for key, array in state.arrays.items() if key not in own}
        self.learner.set_state(
            replace(state, kind=kind, params=params.pop("learner"), arrays=theirs)
        )
        arrays = {key: state.arrays[key] for key in own}
        self.load(params, arrays, {str(move): move for move in self.moves})

    def restored(self) -> None:
        self._n_proposals, self._last_s = 0, None
        is_mirrored = self.alike and self.learner.abilities.mirrors
        self.learner.mirror = self.kinds.mirror(self.features) if is_mirrored else None
        self._n_values = next((len(node.image) for node in self.learner.nodes()), None)
        self._smoothing.reset()

    def faults(self) -> Iterator[str]:
        if isinstance(self.learner, Stateful):
            self.learner.check()
        for node in self.learner.nodes():
            if not node.votes.keys() <= set(self.moves):
                yield "it has labels that are not among its moves"
                break
