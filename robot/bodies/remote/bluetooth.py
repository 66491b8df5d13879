"""Converts Bluetooth errors of libraries and systems to advice for a person. Pure."""

from __future__ import annotations

_CAUSES = (
    (
        ("notauthorized", "accessdenied", "access denied", "denied", "not authorized"),
        "this computer does not allow the program to use Bluetooth; allow it in the system's "
        "settings (on Linux: add your account to the group 'bluetooth')",
    ),
    (
        ("poweredoff", "powered off", "turned off", "notready", "not ready", "rfkill", "blocked"),
        "this computer's Bluetooth is off; switch it on",
    ),
    (
        ("serviceunknown", "org.bluez", "no such file", "connection refused", "no bluetooth",
         "nobluetooth", "no powered bluetooth", "not available", "not supported", "unsupported",
         "no adapter", "not found on this", "file not found", "dbus", "d-bus"),
        "this computer's Bluetooth is off or missing; plug an adapter in, or start its service "
        "(on Linux: systemctl start bluetooth)",
    ),
    (
        ("inprogress", "in progress"),
        "this computer's Bluetooth is busy with another search; close other programs that use it",
    ),
)  # fmt: skip


def name_trouble(error: BaseException) -> str | None:
    """Return the fault of this computer's Bluetooth; None if the error is something else."""
    reason = getattr(getattr(error, "reason", None), "name", "")
    text = f"{type(error).__name__} {reason} {error}".replace("_", "").lower()
    plain = f"{text} {error}".lower()
    for words, sentence in _CAUSES:
        if any(word in plain for word in words):
            return sentence
    return None
