"""Train a learner again on recorded episodes, as fast as the machine can."""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter
from pathlib import Path

from robot.errors import ConfigurationError, told_as
from robot.policy.policy import Policy
from robot.policy.registry import MOST_NODES, full_name, make_policy
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import EditedEpisode, Report, count_steps, learn_again
from robot.store.folder import Storage, check_name, write_whole
from robot.store.models.model import Model, encode_model, same_nodes, take_model
from robot.store.models.store import ModelStore
from robot.types import DEFAULT_MOVES, Action
from server.cli.parser import progress, whole
from server.recordings.selection import add_data, find_episodes, open_data


def configure(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    text = "the episodes: names, beginnings of names, files, or last"
    add("episodes", nargs="+", metavar="EPISODE", help=text)
    add("--learner", help="learner: KIND or KIND-NUMBER, such as default-64 (default: as driven)")
    text = "maximum number of images that the learner stores (default: as driven)"
    add("--max-nodes", type=whole(1, MOST_NODES), metavar="N", help=text)
    text = (
        "begin with the model that the robot had when the first episode began, not with an empty "
        "one"
    )
    add("--continue", dest="goes_on", action="store_true", help=text)
    text = "save the result: the name of a model, or a file (.npz)"
    add("--out", metavar="MODEL", help=text)
    text = "fail unless the nodes are the same as those learned while driving"
    add("--check", action="store_true", help=text)
    add_data(parser)


def run(args: argparse.Namespace) -> int:
    storage = open_data(args, changes=False)
    episodes = find_episodes(EpisodeStore(storage), args.episodes)
    if args.out:
        _check_out(args.out)
    policy, taught = _begin(args, episodes)
    driven = _driven(policy, episodes[-1], must_be=args.check)
    total = count_steps(episodes)
    started_s = time.monotonic()
    with progress(total, "example", "learn", "episodes") as bar:
        report = learn_again(policy, episodes, on_step=bar.update)
    taught += report.taught
    _say(report, policy, episodes, time.monotonic() - started_s)
    is_same = driven is not None and _compare(policy, driven, episodes, args.goes_on)
    if args.check and not is_same:
        if args.out:
            print(f"{args.out} was not saved")
        return 1
    if args.out:
        _save(args.out, storage, policy, taught)
    return 0


def _check_out(out: str) -> None:
    """Raise ConfigurationError if the model could not be saved at `out`; called before learning."""
    if not out.endswith(".npz"):
        check_name(out)
    elif os.path.lexists(out):
        raise ConfigurationError(f"{out} exists already; choose another with --out")
    else:
        with told_as(ConfigurationError, f"cannot write {out}"):
            write_whole(Path(out), b"")
            Path(out).unlink()


def _begin(
    args: argparse.Namespace, episodes: list[EditedEpisode]
) -> tuple[Policy, Counter[Action]]:
    first = episodes[0][0]
    driven = first.run.get("learner") or "default-32"
    kind, _, number = driven.rpartition("-")
    name = full_name(args.learner or kind, args.max_nodes, number)
    if not args.goes_on:
        moves = tuple(dict.fromkeys(move for e, _ in episodes for move in e.moves))
        return make_policy(name, moves or DEFAULT_MOVES), Counter()
    before = first.model_before()
    if before is None or before.summary.learner != name:
        raise ConfigurationError(
            f"{first.id} began with {before.summary.learner if before else 'an unknown model'}; "
            f"{name} cannot continue from that model"
        )
    return before.to_policy(), Counter(before.summary.taught)


def _say(report: Report, policy: Policy, episodes: list[EditedEpisode], seconds: float) -> None:
    driven_s = sum(episode.duration_s for episode, _ in episodes)
    counts = ", ".join(f"{count} {action.value}" for action, count in report.taught.items())
    print(f"{policy.name}: {report.taught.total()} examples ({counts or 'none'})")
    print(f"{policy.n_nodes} nodes, learned in {seconds:.2f} s from {driven_s:.1f} s of driving")
    if report.missing_frames:
        print(f"{report.missing_frames} examples were left out: their pictures were not recorded")
    if report.left_out_edits:
        print(f"{report.left_out_edits} edits were left out: their learned images no longer exist")


def _driven(policy: Policy, last: EditedEpisode, *, must_be: bool) -> Model | None:
    """Return the model that the learner had after the recorded drive; None if there is none.

    If `must_be` is true, a missing model raises ConfigurationError.
    """
    episode, notes = last
    after = episode.model_after()
    if after is not None and after.summary.learner == policy.name and not notes.edits:
        return after
    if must_be:
        why = "it was edited" if notes.edits else f"it has no model of {policy.name}"
        raise ConfigurationError(f"{episode.id} cannot be used with --check: {why}")
    return None


def _compare(policy: Policy, driven: Model, episodes: list[EditedEpisode], goes_on: bool) -> bool:
    """Print and return whether the policy has the same nodes as the model after the drive."""
    is_same = same_nodes(policy.get_state(), driven.state)
    print(f"the nodes {'are the same as' if is_same else 'differ from'} those learned by driving")
    first = episodes[0][0]
    before = first.model_before()
    knew_something = before is not None and before.summary.n_nodes > 0
    if not is_same and not goes_on and knew_something:
        print(f"{first.id} continued an earlier model; to begin with that model, add: --continue")
    return is_same


def _save(out: str, storage: Storage, policy: Policy, taught: Counter[Action]) -> None:
    model = take_model(policy, taught, saved_at_s=time.time())
    if out.endswith(".npz"):
        with told_as(ConfigurationError, f"cannot write {out}"):
            write_whole(Path(out), encode_model(model))
        print(f"saved as {out}")
    else:
        store = ModelStore(storage)
        name = store.free_name(out)
        store.save(name, model)
        print(f"saved as the model {name!r}")
