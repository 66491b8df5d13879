# A LEGO hub as a robot for Drivelesson (docs/howto/pybricks.md), with Pybricks 3.6 or newer. Set
# ports and speeds, and send it to the hub once, with code.pybricks.com. The hub times every move.
from pybricks.hubs import ThisHub
from pybricks.parameters import Color, Direction, Port, Stop
from pybricks.pupdevices import ForceSensor, Motor, UltrasonicSensor
from pybricks.tools import StopWatch, wait
from uselect import poll
from usys import stdin

LEFT = Motor(Port.A, Direction.COUNTERCLOCKWISE)
RIGHT = Motor(Port.B)
SPEEDS = {  # left and right wheel, in degrees a second
    "forward": (400, 400),
    "left": (-150, 150),
    "right": (150, -150),
    "backward": (-250, -250),
}
EYES, BUMPER = Port.E, Port.F  # an ultrasonic and a force sensor, if there are any
EMPTY_MV, FULL_MV = 6000, 8300  # of the battery; six AA cells: 6000, 9000


def find(kind, port):
    try:
        return kind(port)
    except OSError:  # nothing is plugged in there
        return None


def show(color):
    if color is not shown[0]:
        shown[0] = color
        hub.light.on(color)


def stand():
    LEFT.brake()
    RIGHT.brake()


hub, clock, shown, seq, heard, line = ThisHub(), StopWatch(), [None], 0, 0, b""
eyes, bumper = find(UltrasonicSensor, EYES), find(ForceSensor, BUMPER)
keyboard = poll()
keyboard.register(stdin)
while True:
    if not keyboard.poll(0):
        if shown[0] is not Color.RED and clock.time() - heard > 500:  # nobody is there
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
        name, for_ms, speed, number, seen = words
        name, for_ms, speed = name.decode(), int(for_ms), min(1.0, float(speed))
        if int(number) > seq:
            seq, left_ms = int(number), min(for_ms, 500 - (heard - int(seen)))
            if name in SPEEDS and speed > 0 and left_ms > 0:  # what comes late only stops
                for motor, full in zip((LEFT, RIGHT), SPEEDS[name]):
                    motor.run_time(full * speed, left_ms, Stop.BRAKE, wait=False)
                show(Color.GREEN)
            else:
                stand()
                show(Color.BLUE)
    except (ValueError, TypeError):
        pass  # "?" asks for a report
    share = 100 * (hub.battery.voltage() - EMPTY_MV) // (FULL_MV - EMPTY_MV)
    print(
        seq,
        clock.time(),
        eyes.distance() if eyes else "-",
        int(bumper.pressed()) if bumper else "-",
        max(0, min(100, share)),
    )
