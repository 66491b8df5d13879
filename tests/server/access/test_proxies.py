"""Only a trusted proxy's headers count, and no header makes a new address valid."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.errors import ConfigurationError
from robot.testing import VirtualClock
from server.access.config import NetworkConfig, PublicAddress, read_networks
from server.access.gateway import NetworkGateway
from server.access.pairing import cookie_name
from server.access.proxies import PREFIX, Proxies
from server.gateway.roles import Refusal
from server.gateway.rules import check_host, check_origin

OPENED = ("https://home.example/robot/", "http://10.1.1.1:8080", "http://robot")
PUBLIC = tuple(map(PublicAddress.parse, OPENED))
TRUSTED = read_networks("127.0.0.0/8,10.0.0.2,::1")
PROXIES = Proxies(PUBLIC, TRUSTED, admits_all=False)
ADDRESSES = ("127.0.0.1", "10.0.0.2", "10.0.0.1", "6.6.6.6", "forged", "", "[2001:db8::1]:99")
NAMES = ("x-forwarded-for", "x-forwarded-host", "x-forwarded-proto", "forwarded")


def scope(peer: str = "127.0.0.1", path: str = "/", **headers: str) -> dict[str, Any]:
    sent = {"host": "127.0.0.1:8000", **headers}
    return {
        "type": "http",
        "scheme": "http",
        "path": path,
        "client": (peer, 1),
        "headers": [(k.replace("_", "-").encode(), v.encode()) for k, v in sent.items()],
    }


def seen(**what: Any) -> dict[str, Any]:
    found = PROXIES.see_through(scope(**what))
    assert not isinstance(found, Refusal), found.sentence
    return dict(found)


def host_of(found: dict[str, Any]) -> str:
    [host] = [value.decode() for name, value in found["headers"] if name == b"host"]
    return str(host)


@pytest.mark.parametrize(
    ("peer", "forwarded", "counted"),
    [
        ("10.0.0.9", "10.0.0.1", "10.0.0.9"),
        ("127.0.0.1", "", "127.0.0.1"),
        ("::ffff:127.0.0.1", "10.0.0.1", "10.0.0.1"),
        ("127.0.0.1", "10.0.0.1", "10.0.0.1"),
        ("127.0.0.1", "10.0.0.1:4711", "10.0.0.1"),
        ("::1", "[2001:db8::1]:4711", "2001:db8::1"),
        ("127.0.0.1", "6.6.6.6, 10.0.0.1", "10.0.0.1"),
        ("127.0.0.1", "6.6.6.6, 10.0.0.1, 10.0.0.2", "10.0.0.1"),
        ("127.0.0.1", "6.6.6.6, forged, 10.0.0.2", "10.0.0.2"),
        ("127.0.0.1", "forged", "127.0.0.1"),
        ("127.0.0.1", "2001:db8::5", "2001:db8::5"),
        ("127.0.0.1", "1:2:3:4:5:6:7:8", "1:2:3:4:5:6:7:8"),
    ],
)
def test_the_client_is_the_first_address_that_is_not_a_proxy(peer, forwarded, counted):
    assert seen(peer=peer, x_forwarded_for=forwarded)["client"][0] == counted
    elements = ", ".join(f'for="{one.strip()}";by=x' for one in forwarded.split(","))
    assert seen(peer=peer, forwarded=elements)["client"][0] == counted


@pytest.mark.parametrize("begun", ['for=6.6.6.6;by="', 'for=6.6.6.6;by="a', 'for="6.6.6.6', '"'])
def test_no_header_of_a_client_hides_what_the_proxy_adds(begun):
    added = 'for="10.0.0.1";host=robot'
    assert seen(forwarded=f"{begun}, {added}")["client"][0] == "127.0.0.1"
    assert seen(forwarded=f"x-id=1; for=6.6.6.6, {added}")["client"][0] == "10.0.0.1"
    asked = scope(x_forwarded_for="6.6.6.6")  # the first header line is the client's own
    asked["headers"].append((b"X-Forwarded-For", b"10.0.0.1"))
    assert PROXIES.see_through(asked)["client"][0] == "10.0.0.1"


@pytest.mark.timeout(60)
@pytest.mark.parametrize("letters", ["a", "a-", "a ", 'a="', "a=,", '"', "\\"])
def test_no_header_takes_long_to_read(letters):
    """In an earlier version, a header of 8,000 letters, which nginx passes on, blocked the robot
    for a second."""
    seen(forwarded=letters * (100_000 // len(letters)))


@pytest.mark.parametrize(
    ("headers", "host", "scheme"),
    [
        ({}, "home.example", "https"),
        ({"host": "backend"}, "home.example", "https"),
        ({"host": "robot"}, "robot", "http"),
        ({"x_forwarded_host": "10.1.1.1"}, "10.1.1.1:8080", "http"),
        ({"x_forwarded_host": "elsewhere, home.example:443"}, "home.example", "https"),
        ({"forwarded": 'For=10.0.0.1;Host="10.1.1.1:8080";proto=http'}, "10.1.1.1:8080", "http"),
        ({"forwarded": "for=unknown;host=robot"}, "robot", "http"),
    ],
)
def test_headers_choose_among_the_addresses_that_people_open(headers, host, scheme):
    found = seen(**headers)
    assert (host_of(found), found["scheme"]) == (host, scheme)
    elsewhere = PROXIES.see_through(scope(x_forwarded_host="elsewhere"))
    assert isinstance(elsewhere, Refusal) and elsewhere.status == 421
    for path in ("/api/stop", "/robot/api/stop"):  # some proxies remove the prefix
        found = seen(path=path, x_forwarded_host="home.example")
        assert (found["path"], found[PREFIX]) == ("/api/stop", "/robot")


@given(
    peer=st.sampled_from(["10.0.0.9", "127.0.0.1"]),
    headers=st.dictionaries(
        st.sampled_from(NAMES),
        st.lists(
            st.sampled_from([*ADDRESSES, "for=6.6.6.6;host=evil", 'host="evil"', "https", "evil"])
            | st.text(alphabet='",;=[]:. afo\\6', max_size=9),
            max_size=4,
        ).map(",".join),
    ),
)
def test_no_header_adds_an_address_and_headers_of_untrusted_proxies_are_ignored(peer, headers):
    asked = scope(peer=peer, **headers)
    found = PROXIES.see_through(asked)
    if peer == "10.0.0.9":
        assert found is asked
    elif isinstance(found, Refusal):
        assert found.status in (400, 421) and found.sentence
    else:
        assert host_of(dict(found)) in {public.host for public in PUBLIC}
        assert found["client"][0] == "127.0.0.1" or found["client"][0] in str(headers)


def test_headers_that_disagree_are_refused_so_a_client_cannot_add_the_other_kind():
    found = PROXIES.see_through(scope(x_forwarded_for="10.0.0.1", forwarded="for=6.6.6.6"))
    assert isinstance(found, Refusal) and found.status == 400
    assert seen(x_forwarded_for="10.0.0.1", forwarded="for=10.0.0.1")["client"][0] == "10.0.0.1"


def test_without_the_setting_a_request_from_a_proxy_is_told_what_to_set():
    gateway = NetworkGateway(NetworkConfig(), VirtualClock())
    asked = {"host": "127.0.0.1:8000", "origin": "https://home.example"}
    refused = check_origin(gateway, asked, "http", "POST")
    assert "Origin is https://home.example" in refused.sentence
    assert "--behind-proxy https://home.example" in refused.sentence
    wrong = check_host(gateway, {"host": "home.example"})
    assert wrong is not None and "--behind-proxy http://home.example" in wrong.sentence
    open_to_all = Proxies((), (), admits_all=True)
    paired = Proxies((), (), admits_all=False)
    for name in NAMES:
        sent = scope(**{name: "10.0.0.1"})
        refused = open_to_all.see_through(sent)
        assert isinstance(refused, Refusal)
        assert name in refused.sentence.lower() and "--behind-proxy" in refused.sentence
        assert paired.see_through(sent) is sent, "the headers are ignored"
    plain = scope()
    assert open_to_all.see_through(plain) is plain


def test_addresses_are_read_as_browsers_send_them():
    for text, host, prefix, origin in (
        ("https://Home.Example/robot/", "home.example", "/robot", "https://home.example"),
        ("https://home.example:443", "home.example", "", "https://home.example"),
        ("http://h:8080/a/b", "h:8080", "/a/b", "http://h:8080"),
        ("http://[::1]:80/", "[::1]", "", "http://[::1]"),
        ("http://bücher.example", "xn--bcher-kva.example", "", "http://xn--bcher-kva.example"),
    ):
        address = PublicAddress.parse(text)
        assert (address.host, address.prefix, address.origin) == (host, prefix, origin)
    wrong = ("home.example", "ftp://h", "https://", "http://h:x", "http://h/?q", "http://u:p@h", "")
    for text in wrong:
        with pytest.raises(ConfigurationError, match=r"--behind-proxy .* such as https://"):
            PublicAddress.parse(text)
    with pytest.raises(ConfigurationError, match="--proxy-at"):
        read_networks("localhost")


def test_robots_behind_one_proxy_have_cookies_of_their_own():
    places = ("https://h/one", "https://h/two", "https://h:8443", "https://h", "http://h")
    names = {cookie_name(NetworkConfig(public=(PublicAddress.parse(place),))) for place in places}
    assert len(names) == len(places)
    assert "__Host-drivelesson-h" in names and "__Secure-drivelesson-h-one" in names
