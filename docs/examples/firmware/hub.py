# A LEGO hub as a robot for Drivelesson (docs/howto/pybricks.md), with Pybricks 3.6 or newer. Set
# ports and speeds, and load this onto the hub once (code.pybricks.com). The hub ends every move.
from pybricks.hubs import ThisHub
from pybricks.parameters import Color, Direction, Port, Stop
from pybricks.pupdevices import ForceSensor, Motor, UltrasonicSensor
from pybricks.tools import StopWatch, wait
from uselect import poll
from usys import stdin

LEFT = Motor(Port.A, Direction.COUNTERCLOCKWISE)
RIGHT = Motor(Port.B)
SPEEDS = {  # of the left and the right wheel, in degrees per second
    "forward": (400, 400),
    "left": (-150, 150),
    "right": (150, -150),
    "backward": (-250, -250),
}
EYES, BUMPER = Port.E, Port.F  # ultrasonic sensor and force sensor (both optional)
TOP_SPEED, EMPTY_MV, FULL_MV = 1000, 6000, 8300  # deg/s, mV, mV; with six AA cells: 9000 mV


def find(kind, port):
    try:
        return kind(port)
    except OSError:  # no device at this port
        return None


def show(color):
    if color is not shown[0]:
        shown[0] = color
        hub.light.on(color)


def stand():
    LEFT.brake()
    RIGHT.brake()


def blend(side, gas):  # interpolate the moves (each is at half throttle), up to TOP_SPEED
    way, turn = "forward" if gas >= 0 else "backward", "right" if side > 0 else "left"
    rest, spin = 2 * abs(gas) * (1 - abs(side)), abs(side) * max(min(1, 1 + 4 * gas), 2 * gas, -1)
    pair = [rest * a + spin * b for a, b in zip(SPEEDS[way], SPEEDS[turn])]
    return [speed / max(1, max(map(abs, pair)) / TOP_SPEED) for speed in pair]


hub, clock, shown, seq, heard, line = ThisHub(), StopWatch(), [None], 0, 0, b""
eyes, bumper = find(UltrasonicSensor, EYES), find(ForceSensor, BUMPER)
keyboard = poll()
keyboard.register(stdin)
while True:
    if not keyboard.poll(0):
        if shown[0] is not Color.RED and clock.time() - heard > 500:  # connection lost
            stand()
            show(Color.RED)
        wait(5)
        continue
    byte = stdin.buffer.read(1)
    if byte != b"\n":
        line = (line + byte)[-80:]
        continue
    words, line, heard = line.split(), b"", clock.time()
    try:
        name, for_ms, speed, number, seen, *point = words
        name, for_ms, speed = name.decode(), int(for_ms), min(1.0, float(speed))
        if int(number) > seq:
            seq, left_ms = int(number), min(for_ms, 500 - (heard - int(seen)))
            pair = blend(*map(float, point)) if point else SPEEDS.get(name)
            if pair and speed > 0 and left_ms > 0:  # a late command only stops
                for motor, full in zip((LEFT, RIGHT), pair):
                    motor.run_time(full * speed, left_ms, Stop.BRAKE, wait=False)
                show(Color.GREEN)
            else:
                stand()
                show(Color.BLUE)
    except (ValueError, TypeError):
        pass  # "?" only requests a report
    share = 100 * (hub.battery.voltage() - EMPTY_MV) // (FULL_MV - EMPTY_MV)
    far, bumped = eyes.distance() if eyes else "-", int(bumper.pressed()) if bumper else "-"
    print(seq, clock.time(), far, bumped, max(0, min(100, share)), "points")
