"""Which client has the lease of control, and which one gets it next."""

from server.clients.lease import Lease


def test_a_lapsed_wheel_goes_to_the_first_client_that_waits_or_asks():
    lease = Lease()
    lease.join("a", 0.0)
    assert not lease.pass_on_if_lapsed(9.0), "no client waits"
    lease.renew(9.0)
    lease.take("b", 9.5)
    assert not lease.pass_on_if_lapsed(10.0)
    assert lease.pass_on_if_lapsed(10.6)
    assert lease.owner == "b"
    assert lease.take("c", 20.0), "b has been silent"


def test_a_lease_lasts_to_its_very_end_and_a_second_and_a_half_by_default():
    lease = Lease()
    assert lease.join("c1", 10.0)
    assert not lease.take("c2", 11.5), "the lease lasts to its exact end"
    assert not lease.pass_on_if_lapsed(11.5)
    assert lease.pass_on_if_lapsed(11.5 + 1e-6)
    assert lease.owner == "c2"


def test_clients_get_the_wheel_in_the_order_of_their_requests():
    lease = Lease()
    assert lease.join("a", 0.0) and not lease.join("b", 0.1)
    for client in "bcdb":
        assert not lease.take(client, 0.1)
    assert not lease.join("new", 2.0), "the lease has lapsed, but other clients wait"
    assert lease.take("b", 2.0), "b asked first"
    assert not lease.give_up("d", 2.1), "d no longer waits"
    assert lease.give_up("b", 2.2)
    assert lease.owner == "c"
    lease.take("b", 2.3)
    assert not lease.pass_on_if_lapsed(3.7), "c has had the wheel only since 2.2"
    assert lease.pass_on_if_lapsed(3.8)
    assert lease.owner == "b"
    assert lease.give_up("b", 3.9)
    assert lease.owner is None
