"""Questions and their scores; the built-in questionnaires are in questionnaires.toml. Pure.

Sources: S. G. Hart and L. E. Staveland, "Development of NASA-TLX" (1988), unweighted ("raw"): the
mean of six scales from 0 to 100 in steps of 5. Trust: the mean, from 1 to 7, of three items from
the questionnaire of Jian, Bisantz and Drury, "Foundations for an empirically determined scale of
trust in automated systems" (2000). The closing question is taken from the experiment of FLAIRS-30
(2017), but worded differently. All translations are our own.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from robot.devices.raw_value import must_be, text, whole
from robot.errors import ConfigurationError
from robot.study.plan_table import PlanTable, Words, words

LONGEST_ANSWER = 1000
_OF_KIND = {"scale": ("least", "most", "step", "low", "high"), "choice": ("options",), "text": ()}


class Question(PlanTable):
    """One question. The answer is a whole number on a scale, the number of the chosen option (from
    1), or a text, depending on `kind`."""

    name: str = text()
    text: Words = words()
    kind: Literal["scale", "choice", "text"] = must_be("'scale', 'choice' or 'text'", "scale")
    when: Literal["each", "end"] = must_be("'each' or 'end'", "each")
    least: int = whole(1, least=0, most=100)
    most: int = whole(7, least=1, most=100)
    step: int = whole(1, least=1, most=100)
    low: Words = words({})
    high: Words = words({})
    options: list[Words] = must_be("a list of 2 to 20 texts", [])

    @classmethod
    def known(cls, table: Mapping[str, Any]) -> Sequence[str]:
        own = _OF_KIND.get(str(table.get("kind", "scale")), ())
        return ("name", "text", "kind", "when", *own)

    def check_together(self) -> None:
        if self.kind == "choice" and not 2 <= len(self.options) <= 20:
            raise ValueError("'options' must be a list of 2 to 20 texts")
        if self.kind == "scale" and not self.least < self.least + self.step <= self.most:
            raise ValueError("'most' must be at least 'least' plus 'step'")

    def check(self, answer: Any) -> str:
        """Return an answer in its stored form; raises ConfigurationError for an invalid answer."""
        if self.kind == "text":
            if not isinstance(answer, str) or len(answer) > LONGEST_ANSWER:
                raise ConfigurationError(
                    f"the answer to {self.name!r} must be a text of at most {LONGEST_ANSWER} "
                    "characters"
                )
            return " ".join(answer.encode("utf-8", "replace").decode().split())
        least, most = (1, len(self.options)) if self.kind == "choice" else (self.least, self.most)
        step = 1 if self.kind == "choice" else self.step
        is_whole = isinstance(answer, int) and not isinstance(answer, bool)
        if not is_whole or not least <= answer <= most or (answer - least) % step:
            steps = f" in steps of {step}" if step > 1 else ""
            raise ConfigurationError(
                f"the answer to {self.name!r} must be a whole number from {least} to {most}{steps}"
            )
        return str(answer)


SCORES = {"nasa_tlx": "nasa-tlx", "trust": "trust"}
"""Maps each column of scores to its questionnaire. A score is the mean of the answers to this
questionnaire."""


def scores(answers: Mapping[str, Any]) -> dict[str, float]:
    found = {}
    for column, questionnaire in SCORES.items():
        names = [question.name for question in questionnaires()[questionnaire]]
        given = [answers[name] for name in names if answers.get(name) is not None]
        if len(given) == len(names):
            found[column] = sum(given) / len(names)
    return found


@functools.cache
def questionnaires() -> Mapping[str, tuple[Question, ...]]:
    """Return the built-in questionnaires: `nasa-tlx`, `trust`, `closing`."""
    import tomllib

    text = (Path(__file__).parent / "questionnaires.toml").read_text("utf-8")
    return {
        name: tuple(Question(**question) for question in questions)
        for name, questions in tomllib.loads(text).items()
    }
