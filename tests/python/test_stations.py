"""Names: what RPC, Connect, DCP and LLDP say about a device, put together by IP and MAC."""

from __future__ import annotations

import pytest
from talk import pdus

from ds47.lab import wire
from ds47.lab.client import OK, Client, drive
from ds47.lab.naming import dcp_identify, lldp
from ds47.model import Device
from ds47.profinet.calls import CallTracker
from ds47.profinet.link import Packet
from ds47.profinet.rpc import Pdu
from ds47.profinet.stations import Stations
from ds47.spec.semantics import limits

DRIVE = drive()


def seen(*pdus_: Pdu, naming: Stations | None = None) -> Stations:
    naming = naming or Stations()
    for pdu in pdus_:
        naming.message(pdu)
    return naming


def station(kind: str = "dcp", name: str = "press-1") -> Packet:
    data = dcp_identify(DRIVE, name) if kind == "dcp" else lldp(DRIVE, name)
    return Packet(kind, 1, 0, data, DRIVE.mac, "01:0e:cf:00:00:00")  # type: ignore[arg-type]


def test_a_response_names_its_device() -> None:
    asked, answered = pdus(lambda client: client.poll())
    assert seen(asked).devices() == []  # that somebody was asked proves nothing
    (device,) = seen(asked, answered).devices()
    assert device == Device(DRIVE.ip, DRIVE.mac, None, 0x002A, 0x0501)


def test_a_connect_names_the_device_but_not_its_mac() -> None:
    connect = pdus(lambda client: client.ask(client.call(wire.CONNECT), b""))
    assert seen(*connect).devices() == [Device(DRIVE.ip, None, None, 0x002A, 0x0501)]


def test_the_answer_to_a_control_call_is_no_device() -> None:
    def control(client: Client) -> None:
        client.accept(client.call(wire.CONTROL), OK, b"")

    assert seen(*pdus(control)).devices() == []


@pytest.mark.parametrize("kind", ["dcp", "lldp"])
@pytest.mark.parametrize("first", [True, False])
def test_a_station_name_whenever_it_comes(kind: str, first: bool) -> None:
    naming = Stations()
    if first:
        naming.station(station(kind))
    seen(*pdus(lambda client: client.poll()), naming=naming)
    if not first:
        naming.station(station(kind))
    (device,) = naming.devices()
    assert device.station == "press-1"
    assert device.mac == DRIVE.mac


def test_the_newest_name_counts_and_what_it_leaves_open_stays() -> None:
    naming = seen(*pdus(lambda client: client.ask(client.call(wire.CONNECT), b"")))
    naming.station(station("dcp", "old"))
    naming.station(station("lldp", "new"))  # says nothing of vendor and device
    (device,) = naming.devices()
    assert (device.station, device.vendor_id, device.device_id) == ("new", 0x002A, 0x0501)


def test_a_station_that_never_spoke_rpc_is_no_device() -> None:
    naming = Stations()
    naming.station(station())
    assert naming.devices() == []


def test_whoever_repeats_a_response_is_a_device() -> None:
    naming, (asked, answered) = Stations(), pdus(lambda client: client.poll())
    _, again = pdus(lambda client: client.poll())
    again.source = again.server = "192.168.133.99"
    again.mark += 1
    tracker = CallTracker(limits(), stations=naming)
    assert [len(tracker.take(each)) for each in (asked, answered, again)] == [1, 1, 0]
    assert [each.ip for each in naming.devices()] == [DRIVE.ip, "192.168.133.99"]


def test_devices_stand_in_the_order_of_first_sight() -> None:
    two = pdus(lambda client: client.poll(), device=drive(2))
    one = pdus(lambda client: client.poll())
    assert [device.ip for device in seen(*two, *one, *two).devices()] == [drive(2).ip, DRIVE.ip]
