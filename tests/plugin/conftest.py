from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.plugin.environment import OwnEnvironment

HOWTO = Path(__file__).parents[2] / "docs/howto/write-a-driver.md"


@pytest.fixture(scope="package")
def environment(tmp_path_factory: pytest.TempPathFactory) -> OwnEnvironment:
    return OwnEnvironment(tmp_path_factory.mktemp("kit") / "venv")


@pytest.fixture(scope="package")
def followed(
    environment: OwnEnvironment, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, list[str]]:
    """Follow the how-to's commands in an empty folder; return it, and their output."""
    folder = tmp_path_factory.mktemp("howto")
    [block] = re.findall(r"```console\n(.*?)```", HOWTO.read_text("utf-8"), re.DOTALL)
    commands = [line.removeprefix("$ ") for line in block.splitlines() if line]
    assert len(commands) == 3
    return folder, [environment.run(command, folder) for command in commands]
