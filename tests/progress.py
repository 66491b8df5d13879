"""Prints the running tests and the progress, a line for each file: `pytest -p tests.progress`."""

import time
from collections import Counter
from collections.abc import Iterable
from typing import Any

import pytest


class Progress:
    """Counts the tests of each file, and reports each file whose last test has ended."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._left: Counter[str] = Counter()
        self._ended: dict[str, Counter[str]] = {}
        self._began_s = time.monotonic()
        self._total = 0

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Count the tests that this process has collected, unless there are workers."""
        self._expect(item.nodeid for item in session.items)

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_node_collection_finished(self, node: Any, ids: list[str]) -> None:
        """Count the tests of one worker, because all workers have collected the same."""
        if not self._total:
            self._expect(ids)

    def _expect(self, ids: Iterable[str]) -> None:
        self._left.update(map(_file, ids))
        self._total = self._left.total()

    def pytest_report_teststatus(self, report: pytest.TestReport) -> tuple[str, str, str] | None:
        """Count an outcome, for which pytest then prints no dot."""
        is_one = report.when == "call" or (report.when == "setup" and not report.passed)
        if report.when == "teardown" and report.passed:
            return None
        if is_one:
            self._ended.setdefault(_file(report.nodeid), Counter())[report.outcome] += 1
            if report.failed:
                self._write(f"FAILED {report.nodeid}")
        return (report.outcome, "", report.outcome.upper()) if is_one else None

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """Report a file whose tests have all ended."""
        file = _file(nodeid)
        self._left[file] -= 1
        if not self._left[file]:
            share = 1 - self._left.total() / max(self._total, 1)
            outcomes = ", ".join(f"{n} {what}" for what, n in self._ended[file].items())
            took_s = time.monotonic() - self._began_s
            self._write(f"[{share:4.0%} {took_s // 60:.0f}:{took_s % 60:02.0f}] {file}: {outcomes}")

    def _write(self, line: str) -> None:
        reporter = self._config.pluginmanager.get_plugin("terminalreporter")
        assert reporter is not None
        reporter.ensure_newline()
        reporter.write_line(line)


def _file(nodeid: str) -> str:
    return nodeid.partition("::")[0]


def pytest_configure(config: pytest.Config) -> None:
    """Follow the tests in the process that starts the workers, not in the workers."""
    if not hasattr(config, "workerinput"):
        config.option.verbose = min(config.option.verbose, -1)
        config.pluginmanager.register(Progress(config), "progress")
