"""The page for a browser that opened the robot by an unknown name; it shows the right address."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

_WORDS = {
    "en": (
        "This robot has another address",
        "It does not answer to the name {name}. Open it here:",
        "If the name is right, start the robot with {option}.",
    ),
    "es": (
        "Este robot tiene otra dirección",
        "No responde al nombre {name}. Ábrelo aquí:",
        "Si el nombre es correcto, inicia el robot con {option}.",
    ),
    "zh": (
        "这个机器人的地址不同",
        "它不使用名称 {name}。请从这里打开：",
        "如果名称没有错，请用 {option} 启动机器人。",
    ),
}


def language_of(accepted: str) -> str:
    """Return the first language of an Accept-Language header that the page supports, or English."""
    for part in accepted.split(","):
        code = part.strip()[:2].lower()
        if code in _WORDS:
            return code
    return "en"


def explain_unknown_name(name: str, open_at: Sequence[str], accepted: str) -> bytes:
    """Return the page as HTML; `accepted` is the browser's Accept-Language header."""
    code = language_of(accepted)
    title, sentence, advice = _WORDS[code]
    shown = f"<b>{escape(name)}</b>"
    option = f"<code>--also-at {escape(name)}</code>"
    links = "".join(
        f'<li><a href="{escape(address)}/">{escape(address)}</a></li>' for address in open_at
    )
    return (
        f'<!doctype html><html lang="{code}"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>Drivelesson</title><h1>{title}</h1>"
        f"<p>{sentence.format(name=shown)}</p><ul>{links}</ul>"
        f"<p>{advice.format(option=option)}</p></html>"
    ).encode()
