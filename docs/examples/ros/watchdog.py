"""Stops a ROS 2 robot when Drivelesson, its computer or the network fails.

This node runs on the robot's computer, beside rosbridge (docs/howto/ros.md). It forwards the
velocities that Drivelesson (`--robot ros --watchdog true`) sends to the robot's base. An order
expires HOLD_S after its arrival, and FRESH_S after the keep-alive that it answers, so a delayed
order moves nothing. The clocks may differ, because each order returns this node's own time. The
robot also stops if another node or a second Drivelesson drives at the same time.
"""

import time

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Header

HOLD_S = 0.3
FRESH_S = 0.45
LOOK_EVERY_S = 0.01
SIGN_EVERY_S = 0.05
ECHO_S = 0.15
DISPUTE_S = 0.5


class Watchdog(Node):
    def __init__(self):
        super().__init__("drivelesson_watchdog")
        self.stamped = self.declare_parameter("stamped", False).value
        topic = self.declare_parameter("cmd_vel_topic", "/cmd_vel").value
        self.base = self.create_publisher(TwistStamped if self.stamped else Twist, topic, 1)
        self.signs = self.create_publisher(Header, "/drivelesson/alive", 1)
        self.create_subscription(TwistStamped, "/drivelesson/cmd_vel", self.take, 1)
        self.create_subscription(TwistStamped if self.stamped else Twist, topic, self.hear, 10)
        self.ends_s = self.signed_s = self.seen_s = self.ordered_s = self.disputed_s = 0.0
        self.driver, self.passed = "", []
        self.create_timer(LOOK_EVERY_S, self.look)
        self.pass_on(Twist())

    def take(self, order):
        now_s = time.monotonic()
        seen_s = order.header.stamp.sec + order.header.stamp.nanosec / 1e9
        ends_s = min(now_s + HOLD_S, seen_s + FRESH_S)
        if order.twist == Twist():
            self.ends_s = 0.0  # a stop is obeyed however late it arrives
            self.pass_on(order.twist)
        elif self.seen_s <= seen_s <= now_s < ends_s:  # neither late nor from before a restart
            if self.driver != order.header.frame_id and now_s < self.ordered_s + HOLD_S:
                self.dispute(now_s)
            self.driver, self.ordered_s, self.seen_s = order.header.frame_id, now_s, seen_s
            if now_s >= self.disputed_s + DISPUTE_S:
                self.ends_s = ends_s
                self.pass_on(order.twist)

    def hear(self, velocity):  # all velocities on the base's topic, from this node and others
        now_s = time.monotonic()
        twist = velocity.twist if self.stamped else velocity
        self.passed = [(at_s, one) for at_s, one in self.passed if now_s < at_s + ECHO_S]
        is_ours = twist == Twist() or any(twist == one for _, one in self.passed)
        if not is_ours and now_s < self.ordered_s + DISPUTE_S:
            self.dispute(now_s)

    def dispute(self, now_s):
        self.disputed_s, self.ends_s = now_s, 0.0
        self.pass_on(Twist())

    def look(self):
        now_s = time.monotonic()
        if self.ends_s and now_s >= self.ends_s:
            self.ends_s = 0.0
            self.pass_on(Twist())
        if now_s - self.signed_s >= SIGN_EVERY_S:
            self.signed_s = now_s
            sign = Header()
            sign.stamp.sec, sign.stamp.nanosec = int(now_s), int(now_s % 1.0 * 1e9)
            sign.frame_id = "disputed" if now_s < self.disputed_s + DISPUTE_S else ""
            self.signs.publish(sign)

    def pass_on(self, twist):
        self.passed.append((time.monotonic(), twist))
        if self.stamped:
            velocity = TwistStamped()
            velocity.header.stamp = self.get_clock().now().to_msg()
            velocity.header.frame_id, velocity.twist = "base_link", twist
            self.base.publish(velocity)
        else:
            self.base.publish(twist)


def main():
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # so that the final stop is sent
    node = Watchdog()
    try:
        rclpy.spin(node)
    finally:
        node.pass_on(Twist())


if __name__ == "__main__":
    main()
