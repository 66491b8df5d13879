# A robot with two motors for Drivelesson (docs/howto/any-robot.md): MicroPython on an ESP32 or a
# Raspberry Pi Pico W. Set these, save the file as main.py, and use the address that it prints.
import binascii, hashlib, json, os, select, socket, sys, time

WIFI, PASSWORD, SECRET, PORT = "school", "chalk", b"change me", 4210
PINS = ((16, 17), (18, 19))  # left motor, right motor: forward, backward
SPEEDS = {"forward": (1, 1), "left": (-0.5, 0.5), "right": (0.5, -0.5), "backward": (-0.6, -0.6)}
try:
    import network
    from machine import PWM, Pin

    wlan = network.WLAN(network.STA_IF)
    wlan.active(True)
    wlan.connect(WIFI, PASSWORD)
    while not wlan.isconnected():
        time.sleep_ms(100)
    print("--robot udp --address %s:%d" % (wlan.ifconfig()[0], PORT))
    pwms = [[PWM(Pin(pin), freq=1000, duty_u16=0) for pin in pair] for pair in PINS]

    def wheels(*speeds):
        for pair, speed in zip(pwms, speeds):
            pair[0].duty_u16(int(65535 * max(0, speed)))
            pair[1].duty_u16(int(65535 * max(0, -speed)))
except ImportError:  # on a computer, for its test: says what it does
    SECRET, PORT = sys.argv[1].encode(), int(sys.argv[2])

    def wheels(*speeds):
        print(time.ticks_ms(), *speeds)


def sign(text):  # HMAC-SHA256, its first 16 figures
    key = SECRET + bytes(64 - len(SECRET))
    inner = hashlib.sha256(bytes(b ^ 0x36 for b in key) + nonce + text).digest()
    return binascii.hexlify(hashlib.sha256(bytes(b ^ 0x5C for b in key) + inner).digest())[:16]


nonce, seq, ends, moving = binascii.hexlify(os.urandom(8)), 0, 0, False
sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
sock.bind(socket.getaddrinfo("0.0.0.0", PORT)[0][-1])
poll = select.poll()
poll.register(sock, select.POLLIN)
while True:
    came, now = poll.poll(10), time.ticks_ms()
    if moving and time.ticks_diff(ends, now) <= 0:  # nobody renewed the move: stand
        moving = wheels(0, 0)
    if came:
        data, sender = sock.recvfrom(512)
        try:
            text, _, mac = data.partition(b"\t")
            order = json.loads(text)
            if mac == sign(text) and order["seq"] > seq:
                seq, age_ms = order["seq"], time.ticks_diff(now, order["seen_ms"])
                speeds = [min(1, order["speed"]) * s for s in SPEEDS.get(order["move"], (0, 0))]
                moving = any(speeds) and age_ms < 500  # an order that comes late only stops
                ends = time.ticks_add(now, min(order["for_ms"], 500 - age_ms))
                wheels(*(speeds if moving else (0, 0)))
        except (ValueError, KeyError, TypeError):
            pass  # not for us
        sock.sendto(json.dumps({"nonce": nonce.decode(), "seq": seq, "ms": now}).encode(), sender)
