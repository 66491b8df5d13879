"""List, show, edit, delete, restore, import and export recorded episodes."""

from __future__ import annotations

import argparse
import contextlib
import shutil
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from robot.entry_points import points
from robot.errors import ConfigurationError, told_as
from robot.recordings.archive import zip_recordings
from robot.recordings.editing import EpisodeFrame, edit_of, labels, sample
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode
from robot.recordings.folder import NAME
from robot.recordings.free_path import free_path
from robot.recordings.reading import reading
from robot.recordings.rejoining import strays
from robot.recordings.store import EpisodeStore
from robot.recordings.summary import EpisodeSummary
from robot.recordings.trash import TRASH_DAYS
from robot.store.folder import (
    Storage,
    size_below,
    size_of,
    whole_file,
)
from server.cli.parser import number
from server.recordings.selection import (
    EPISODE_HELP,
    EpisodeVerb,
    add_data,
    add_several,
    find_episodes,
    find_id,
    find_ids,
    open_data,
)

_LETTERS = {"forward": "F", "left": "L", "right": "R", "backward": "B", "stop": "."}
_AXIS = 96
_RANGED = {
    "trim": "keep only a part of a recording; `undo` reverts this",
    "delete": "delete a part of a recording, or (without --from and --to) whole recordings",
    "relabel": "give a part of a recording another label; `undo` reverts this",
}
_SEARCH_HELP = "list only episodes with these words in name, title, date, labels, robot or learner"
VERBS = "drivelesson.episode-commands"
"""The group of entry points with which extensions add verbs to `drivelesson episodes`. Each entry
point is an `EpisodeVerb`."""


def configure(parser: argparse.ArgumentParser) -> None:
    commands = parser.add_subparsers(dest="verb", required=True, metavar="VERB")

    def add(
        verb: str, action: Any, text: str, *, of_one: bool = True, changes: bool = True
    ) -> argparse.ArgumentParser:
        made: argparse.ArgumentParser = commands.add_parser(verb, help=text, description=text)
        made.set_defaults(action=action, changes=changes, may_create=False)
        if of_one:
            made.add_argument("episode", metavar="EPISODE", help=EPISODE_HELP)
        add_data(made)
        return made

    text = "list all recordings, the newest first"
    listed = add("list", list_episodes, text, of_one=False, changes=False)
    listed.add_argument("--search", metavar="TEXT", help=_SEARCH_HELP)
    text = "show a recording as a timeline of labels and of the robot's proposals"
    add("show", show, text, changes=False)
    for verb, text in _RANGED.items():
        ranged = add(verb, edit, text, of_one=verb != "delete")
        if verb == "delete":
            add_several(ranged)
        for flag, dest in (("--from", "first_s"), ("--to", "last_s")):
            text = f"{'beginning' if dest == 'first_s' else 'end'} of the part, in seconds"
            ranged.add_argument(flag, dest=dest, type=number(least=0), metavar="S", help=text)
        if verb == "relabel":
            text = "the new label: a move, such as left"
            ranged.add_argument("--label", required=True, metavar="MOVE", help=text)
    add("undo", undo, "undo the last edit of a recording")
    text = "write recordings, with their edits, into one zip file"
    zipped = add("zip", write_zip, text, of_one=False, changes=False)
    add_several(zipped)
    zipped.add_argument("--out", type=Path, metavar="FILE", help="zip file (default: in exports/)")
    text = "delete the recordings once the zip file is complete; `restore` brings them back"
    zipped.add_argument("--delete", action="store_true", help=text)
    restore = add("restore", restore_episode, "restore deleted recordings", of_one=False)
    restore.add_argument(
        "key", nargs="?", metavar="WORD", help="word that `delete` printed (default: the last one)"
    )
    add("compact", compact, "apply the edits to the recorded file itself")
    titled = add("title", set_title, "give a recording a title")
    titled.add_argument("title", help="the title; an empty text removes it")
    add("protect", protect, "protect a recording, so that the page never suggests deleting it")
    add("unprotect", protect, "remove the protection of a recording")
    for point in points(VERBS):
        added: EpisodeVerb = point.load()
        made = add(point.name, added.run, added.help, of_one=False, changes=added.changes)
        made.set_defaults(may_create=added.may_create)
        added.configure(made)
    budget = add(
        "budget",
        show_budget,
        "show how much space recordings use, and which recordings could be deleted",
        of_one=False,
        changes=False,
    )
    budget.add_argument("--gigabytes", type=number(least=0), help="set the space for recordings")
    text = f"empty the trash, which otherwise keeps deleted recordings for {TRASH_DAYS} days"
    add("empty-trash", empty_trash, text, of_one=False)


def run(args: argparse.Namespace) -> int:
    storage = open_data(args, changes=args.changes, may_create=args.may_create)
    return int(args.action(args, EpisodeStore(storage), storage) or 0)


def _range(args: argparse.Namespace, episode: Episode) -> tuple[int, int]:
    """Return the ids of the first and the last frame between `args.first_s` and `args.last_s`, in
    seconds since the recording began."""
    first_s = args.first_s if args.first_s is not None else 0.0
    last_s = args.last_s if args.last_s is not None else episode.duration_s + 1.0
    at_s = episode.frames.captured_s - episode.start_s
    ids = episode.frames.ids[(first_s <= at_s) & (at_s <= last_s)]
    if not len(ids):
        raise ConfigurationError(f"there are no pictures between {first_s:g} s and {last_s:g} s")
    return int(ids[0]), int(ids[-1])


# Seeing ------------------------------------------------------------------------------------------


def list_episodes(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> None:
    summaries = store.summaries()
    _print_half_done(storage)
    if not summaries:
        print(f"no episodes in {storage.folder(NAME)}")
        return
    if args.search:
        summaries = [one for one in summaries if one.matches(args.search)]
    print(f"{'episode':27} {'began':16} {'length':>8} {'frames':>6} {'taught':>6} {'MB':>7}  notes")
    for summary in summaries:
        began = "unknown"
        if summary.started_at_s:
            began = datetime.fromtimestamp(summary.started_at_s).strftime("%Y-%m-%d %H:%M")
        print(
            f"{summary.id:27} {began:16} {summary.duration_s:7.1f}s {summary.frames:6} "
            f"{sum(summary.taught.values()):6} {summary.bytes / 1e6:7.1f}  {_remarks(summary)}"
        )
    taught = sum(sum(one.taught.values()) for one in summaries)
    print(
        f"{_count(len(summaries)):27} {'':16} {sum(one.duration_s for one in summaries):7.1f}s "
        f"{sum(one.frames for one in summaries):6} {taught:6} {_megabytes(summaries):7.1f}"
    )


def _count(number: int) -> str:
    return f"{number} episode{'s' * (number != 1)}"


def _megabytes(summaries: Iterable[EpisodeSummary]) -> float:
    return sum(one.bytes for one in summaries) / 1e6


def _print_half_done(storage: Storage) -> None:
    for path in storage.half_done():
        what = path.relative_to(storage.root).as_posix()
        print(
            f"unfinished: {what}, {size_of(path) / 1e6:.1f} MB: the program that wrote it was "
            "interrupted; the next start of the robot, or the next import, removes it"
        )
    for path, name in strays(storage.folder(NAME)):
        print(
            f"{path.name}, {size_below(path) / 1e6:.1f} MB: {name}.mcap is missing; if it was "
            "deleted, the next start of the robot moves these parts to the trash, too"
        )


def _remarks(summary: EpisodeSummary) -> str:
    remarks = [summary.title]
    remarks += ["protected"] if summary.is_protected else []
    remarks += [_edits(summary.edits)] if summary.edits else []
    remarks += [f"damaged: {summary.damage}"] if summary.damage else []
    return ", ".join(remark for remark in remarks if remark)


def show(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> None:
    [(episode, notes)] = find_episodes(store, [args.episode])
    taught = Counter(label.value for label in labels(episode, notes))
    print(f"{episode.id}  {notes.title}".rstrip())
    print(f"robot {episode.run.get('robot') or '-'}, learner {episode.run.get('learner') or '-'}")
    lasted = f"{len(episode.frames)} pictures in {episode.duration_s:.1f} s"
    print(f"{lasted}; taught {dict(taught) or 'nothing'}")
    if episode.damage:
        print(f"damaged: {episode.damage}")
    for n, edit in enumerate(notes.edits, start=1):
        print(f"edit {n}: {edit.verb} {edit.label or ''} {list(edit.ranges)}")
    _print_axis(sample(episode, notes, _AXIS))


def _print_axis(shown: list[EpisodeFrame]) -> None:
    rows: tuple[tuple[str, Callable[[EpisodeFrame], str]], ...] = (
        ("pilot", lambda m: "x" if m.is_deleted else _letter(m.label)),
        ("robot", lambda m: _letter(m.predicted)),
        ("drives", lambda m: {"pilot": "p", "robot": "r"}.get(m.driven_by or "", ".")),
    )
    for name, letter in rows:
        print(f"{name:7}" + "".join(letter(moment) for moment in shown))
    if shown:
        print(f"{shown[0].at_s:<7.1f}" + f"{shown[-1].at_s:.1f} s".rjust(len(shown)))
        print("F forward, L left, R right, B backward; x deleted; p pilot, r robot; - or . nothing")


def _letter(move: str | None) -> str:
    return "-" if move is None else _LETTERS.get(move, move[-1:])


# Editing -----------------------------------------------------------------------------------------


def edit(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> int:
    if args.verb == "delete":
        episode_ids = find_ids(store, args)
        if args.first_s is None and args.last_s is None:
            return _delete(store, episode_ids)
        if len(episode_ids) != 1:
            raise ConfigurationError("--from and --to can be used with only one episode")
        [episode_id] = episode_ids
    else:
        episode_id = find_id(store, args.episode)
    episode = store.open(episode_id)
    label = args.label if args.verb == "relabel" else None
    change = edit_of(args.verb, _range(args, episode), episode, label)
    _print_edits(store.edit(episode_id, change))
    return 0


def _delete(store: EpisodeStore, episode_ids: Sequence[str]) -> int:
    """Delete episodes; the exit status is 1 if some could not be deleted."""
    chosen = {one.id: one for one in store.summaries()}
    gone = store.delete(*episode_ids)
    for episode_id, why in gone.kept.items():
        print(f"{episode_id} was not deleted: {why}", file=sys.stderr)
    if gone.key is not None:
        size = _megabytes(chosen[one] for one in gone.ids if one in chosen)
        what = gone.ids[0] if len(gone.ids) == 1 else _count(len(gone.ids))
        print(
            f"{what} ({size:.1f} MB) moved to the trash for {TRASH_DAYS} days; "
            f"to restore: drivelesson episodes restore {gone.key}"
        )
    return 1 if gone.kept else 0


def write_zip(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> int:
    out = args.out or free_path(storage.exports, "recordings", ".zip")
    if out.exists():
        raise ConfigurationError(f"{out} exists already; choose another with --out")
    episode_ids = find_ids(store, args)
    paths = [store.path(episode_id) for episode_id in episode_ids]
    refusing = told_as(ConfigurationError, f"cannot write {out}")
    with refusing, reading(paths), whole_file(out) as file:
        for block in zip_recordings(paths):
            file.write(block)
    print(f"{out}: {_count(len(paths))}, {size_of(out) / 1e6:.1f} MB")
    return _delete(store, episode_ids) if args.delete else 0


def undo(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> None:
    _print_edits(store.undo_edit(find_id(store, args.episode)))


def _print_edits(notes: Notes) -> None:
    print(f"{_edits(len(notes.edits))}; the recorded file is unchanged")


def _edits(count: int) -> str:
    return f"{count} edit{'s' * (count != 1)}"


def restore_episode(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> None:
    """Restore deleted episodes; without a key, the episodes deleted last."""
    for episode_id in store.restore(args.key or max(store.trash(), default="")):
        print(f"{episode_id} was restored")


def compact(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> None:
    key = store.compact(find_id(store, args.episode))
    print(f"edits applied; to restore the original: drivelesson episodes restore {key}")


def set_title(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> None:
    notes = store.set_title(find_id(store, args.episode), args.title)
    print(f"the title is now {notes.title!r}" if notes.title else "the title was removed")


def protect(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> None:
    episode_id, is_on = find_id(store, args.episode), args.verb == "protect"
    store.protect(episode_id, is_on)
    print(f"{episode_id} is {'never' if is_on else 'again'} suggested for deletion")


# Space -------------------------------------------------------------------------------------------


def show_budget(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> None:
    if args.gigabytes is not None:
        store.budget_bytes = round(args.gigabytes * 1e9)
    print(f"data folder  {storage.root}")
    sizes = {folder.name: size_below(folder) for folder in storage.kept()}
    with contextlib.suppress(OSError):
        sizes["free"] = shutil.disk_usage(storage.root).free
    for name, size in sizes.items():
        print(f"{name:12} {size / 1e6:10.1f} MB")
    print(f"{'budget':12} {store.budget_bytes / 1e6:10.1f} MB for episodes")
    for summary in store.offered():
        print(f"deletable: {summary.id}  {summary.bytes / 1e6:.1f} MB  {summary.title}".rstrip())


def empty_trash(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> None:
    print(f"{storage.empty_trash() / 1e6:.1f} MB are free again")
