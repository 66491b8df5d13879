"""Prepare and analyse studies: write a plan, check a plan, rebuild the table from a study's zip."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from robot.errors import ConfigurationError, quoted, told_as
from robot.study.builtin import TRIALS


def configure(parser: argparse.ArgumentParser) -> None:
    commands = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    new = commands.add_parser(
        "new", help="write the paper's protocol as a plan that you can change"
    )
    new.add_argument("plan", type=Path, metavar="PLAN.toml", help="file to create")
    new.add_argument(
        "--trial", type=int, choices=tuple(TRIALS), default=1, help="trial (default: %(default)s)"
    )
    new.set_defaults(action=_new)
    check = commands.add_parser("check", help="check a plan, and print a summary of it")
    check.add_argument("plan", type=Path, metavar="PLAN.toml", help="the plan")
    check.set_defaults(action=_check)
    report = commands.add_parser("report", help="make the table of results again from a zip file")
    report.add_argument(
        "zip", type=Path, metavar="ZIP", help="the zip file that was downloaded from the page"
    )
    report.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="folder for the table"
    )
    report.set_defaults(action=_report)


def run(args: argparse.Namespace) -> int:
    return int(args.action(args))


def _new(args: argparse.Namespace) -> int:
    from robot.study.builtin import paper_plan

    if args.plan.exists():
        raise ConfigurationError(f"{args.plan} exists already; choose another name")
    with told_as(ConfigurationError, f"cannot write {args.plan}"):
        args.plan.write_text(paper_plan(args.trial), encoding="utf-8")
    print(f"{args.plan} is the paper's protocol of trial {args.trial}. Edit it, then check it:")
    print(f"drivelesson study check {quoted(str(args.plan))}")
    return 0


def _check(args: argparse.Namespace) -> int:
    from robot.study.plan import parse_plan
    from robot.study.rows import refuse_same_columns

    with told_as(ConfigurationError, f"cannot read {args.plan}", OSError, UnicodeDecodeError):
        plan = parse_plan(args.plan.read_text("utf-8"), str(args.plan))
    refuse_same_columns(plan, str(args.plan))
    print(f"{plan.title}: {plan.participants} participants, {len(plan.conditions)} conditions")
    for condition in plan.conditions:
        phases = ", ".join(f"{phase.name} {phase.seconds:g} s" for phase in condition.phases)
        print(f"  {condition.name}: {condition.world}, {' '.join(condition.moves)}; {phases}")
    print(f"Questions: {', '.join(question.name for question in plan.questions) or 'none'}")
    for slot in range(min(plan.participants, plan.balanced_every)):
        print(f"Order {slot + 1}: {', '.join(plan.order(slot))}")
    if plan.participants % plan.balanced_every:
        print(
            f"The order is balanced for {plan.balanced_every}, {2 * plan.balanced_every}, ... "
            f"participants, not for {plan.participants}."
        )
    return 0


def _report(args: argparse.Namespace) -> int:
    from robot.study.archive import report

    same, other = report(args.zip, args.out)
    for path in same:
        print(f"{args.out / path}: the same as in the zip")
    if other:
        print(f"These differ from the files in the zip: {', '.join(other)}", file=sys.stderr)
        return 1
    return 0
