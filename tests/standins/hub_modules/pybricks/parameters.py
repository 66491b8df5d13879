class Port:
    A, B, C, D, E, F = "ABCDEF"


class Direction:
    CLOCKWISE, COUNTERCLOCKWISE = 1, -1


class Color:
    RED, GREEN, BLUE = "red", "green", "blue"


class Stop:
    COAST, BRAKE, HOLD = "coast", "brake", "hold"
