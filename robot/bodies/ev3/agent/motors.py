"""Two tacho motors. Every move is timed: the kernel ends the move even if this program dies."""

import sys
import time
from typing import Any, List, Optional

from robot.bodies.ev3.agent.ports import DevicePort, DriveError, describe_ports, list_ports

RESET_ZERO = ("ramp_up_sp", "ramp_down_sp", "position")
RESET_TRIES = 50


class MotorPair:
    """The left and the right motor, addressed by their ports. A motor may be unplugged and plugged
    in again.

    `clock` has the functions of the module `time`.
    """

    def __init__(self, left: str, right: str, root: str, clock: Any = time) -> None:
        self._clock = clock
        self._addresses = (left, right)
        self._root = root
        self._ports = []  # type: List[DevicePort]
        self._counts_per_deg = []  # type: List[float]
        self._top_counts = []  # type: List[int]
        self._speeds = [None, None]  # type: List[Optional[int]]
        self._time_ms = 0

    def open(self) -> None:
        """Find the left and the right motor, and reset both.

        Another program may have left ramps, a reversed polarity or a running motor; with a ramp
        even `stop` is slow. `reset` undoes all of this, so it comes first.
        """
        self.close()  # close the motors that an earlier call found
        try:
            for side, address in zip(("left", "right"), self._addresses):
                self._ports.append(self._find(side, address))
                self._reset(self._ports[-1])
        except Exception:
            self.close()
            raise
        ports = self._ports
        self._counts_per_deg = [float(motor.read("count_per_rot")) / 360.0 for motor in ports]
        self._top_counts = [int(motor.read("max_speed")) for motor in ports]

    def _find(self, side: str, address: str) -> DevicePort:
        ports = list_ports(self._root, "tacho-motor")
        motor = next((port for port in ports if port.is_at(address)), None)
        if motor is None:
            raise DriveError(
                "no {} motor at port {}; plug it in there, or name its port with "
                "--{}-port ({})".format(side, address, side, describe_ports(ports))
            )
        return motor

    def _reset(self, motor: DevicePort) -> None:
        motor.write("command", "reset")
        for _ in range(RESET_TRIES):
            if all(int(motor.read(name)) == 0 for name in RESET_ZERO):
                if motor.read("polarity") == "normal":
                    motor.write("stop_action", "brake")
                    motor.write("command", "stop")
                    return
            self._clock.sleep(0.01)
        raise DriveError(
            "the motor at {} cannot be reset: another program changes its settings; end that "
            "program, or restart the brick".format(motor.address)
        )

    def top_speeds_dps(self) -> List[float]:
        """Return the top speeds of the left and the right motor, in degrees a second."""
        return [top / count for top, count in zip(self._top_counts, self._counts_per_deg)]

    def run(self, left_dps: float, right_dps: float, time_ms: int) -> None:
        try:
            if not self._ports:
                self.open()
            speeds = [
                int(round(dps * count))
                for dps, count in zip((left_dps, right_dps), self._counts_per_deg)
            ]
            self._check(speeds)
            for index, speed in enumerate(speeds):
                self._set(index, speed, time_ms)
            self._time_ms = time_ms
            for speed, motor in zip(speeds, self._ports):
                motor.write("command", "run-timed" if speed else "stop")
        except DriveError:
            self.stop()
            raise
        except Exception as error:
            self.stop()
            self.close()
            raise self._lost(error) from error

    def _check(self, speeds: List[int]) -> None:
        """Raise an error that contains the top speed; the kernel would return only EINVAL."""
        for address, speed, top in zip(self._addresses, speeds, self._top_counts):
            if abs(speed) > top:
                raise DriveError(
                    "the motor at {} turns at most {} counts a second, not {}; "
                    "lower --forward-speed-mps or --turn-rate-deg-s".format(
                        address, top, abs(speed)
                    )
                )

    def _set(self, index: int, speed: int, time_ms: int) -> None:
        """Write only changed values, because each write takes a millisecond on the brick."""
        motor = self._ports[index]
        if time_ms != self._time_ms:
            motor.write("time_sp", time_ms)
        if speed != self._speeds[index]:
            motor.write("speed_sp", speed)
            self._speeds[index] = speed

    def stop(self) -> None:
        """Stop both motors; if one is unplugged, stop the other. Never raises."""
        for motor in self._ports:
            try:
                motor.write("command", "stop")
            except Exception as error:
                print("cannot stop {}: {}".format(motor.address, error), file=sys.stderr)

    def positions(self) -> List[float]:
        """Return the angles of the left and the right wheel since `open`, in degrees."""
        counts = zip(self._read("position"), self._counts_per_deg)
        return [float(position) / count for position, count in counts]

    def _lost(self, error: object) -> DriveError:
        return DriveError(
            "the motors at {} and {} do not answer ({}); check their cables".format(
                self._addresses[0], self._addresses[1], error
            )
        )

    def states(self) -> List[str]:
        """Return the kernel's state flags of the left and right motor, like "running stalled"."""
        return self._read("state")

    def _read(self, name: str) -> List[str]:
        if not self._ports:
            raise self._lost("they were unplugged")
        try:
            return [str(motor.read(name)) for motor in self._ports]
        except Exception as error:
            raise self._lost(error) from error

    def close(self) -> None:
        """Close the motors; the next `run` finds them again."""
        for motor in self._ports:
            motor.close()
        self._ports, self._speeds, self._time_ms = [], [None, None], 0
