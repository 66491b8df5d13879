# Firmware for a robot with two motors (docs/howto/any-robot.md): MicroPython on an ESP32 or a
# Raspberry Pi Pico W. Edit the constants, save this file as main.py, and use the address it prints.
import binascii, hashlib, json, machine, network, os, select, socket, time

WIFI, PASSWORD, SECRET, PORT = "school", "chalk", b"change me", 4210
PINS = (16, 17, 18, 19)  # left motor, right motor: forward, backward
SPEEDS = {"forward": (1, 1), "left": (-0.5, 0.5), "right": (0.5, -0.5), "backward": (-0.6, -0.6)}
wlan = network.WLAN(network.STA_IF)
wlan.active(True)
wlan.connect(WIFI, PASSWORD)
while not wlan.isconnected():
    time.sleep_ms(100)
print("--robot udp --address %s:%d" % (wlan.ifconfig()[0], PORT))
pwms = [machine.PWM(machine.Pin(pin), freq=1000, duty_u16=0) for pin in PINS]


def wheels(left, right):
    for pwm, speed in zip(pwms, (left, -left, right, -right)):
        pwm.duty_u16(int(65535 * max(0, speed)))
    return left or right


def speeds_of(order):
    pair = SPEEDS.get(order["move"], (0, 0))
    if "steering" in order:  # proportional: interpolate the moves (each is at half throttle)
        side, gas = order["steering"], 2 * order["throttle"]
        way, turn = "forward" if gas >= 0 else "backward", "right" if side > 0 else "left"
        rest, spin = abs(gas) * (1 - abs(side)), abs(side) * max(min(1, 1 + 2 * gas), gas, -1)
        pair = [rest * a + spin * b for a, b in zip(SPEEDS[way], SPEEDS[turn])]
    return [min(1, order["speed"]) / max(1, *map(abs, pair)) * speed for speed in pair]


def sign(text):  # the first 16 hexadecimal digits of an HMAC-SHA256
    key = SECRET + bytes(64 - len(SECRET))
    inner = hashlib.sha256(bytes(b ^ 0x36 for b in key) + nonce + text).digest()
    return binascii.hexlify(hashlib.sha256(bytes(b ^ 0x5C for b in key) + inner).digest())[:16]


nonce, chip = [binascii.hexlify(one) for one in (os.urandom(8), machine.unique_id())]
sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
sock.bind(socket.getaddrinfo("0.0.0.0", PORT)[0][-1])
poll, seq, ends, moving = select.poll(), 0, 0, False
poll.register(sock, select.POLLIN)
while True:
    came, now = poll.poll(10), time.ticks_ms()
    if moving and time.ticks_diff(ends, now) <= 0:  # the move was not renewed: stop
        moving = wheels(0, 0)
    if came:
        data, sender = sock.recvfrom(512)
        try:
            text, _, mac = data.partition(b"\t")
            order = json.loads(text)
            if mac == sign(text) and order["seq"] > seq:
                seq, age_ms = order["seq"], time.ticks_diff(now, order["seen_ms"])
                ends = time.ticks_add(now, min(order["for_ms"], 500 - age_ms))
                moving = wheels(*(speeds_of(order) if age_ms < 500 else (0, 0)))  # late: stop
        except (ValueError, KeyError, TypeError):
            pass  # not a valid command
        report = dict(nonce=nonce.decode(), seq=seq, ms=now, points=True, id=chip.decode())
        sock.sendto(json.dumps(report).encode(), sender)
