"""Names for the devices of a capture: RPC object UUID, Connect, DCP and LLDP, put together by IP and MAC."""

from __future__ import annotations

from collections import OrderedDict
from typing import TypeVar

from ds47.model import Device
from ds47.profinet import dcp, lldp, rpc
from ds47.profinet.link import Packet
from ds47.spec.layouts import RPC_CONNECT, RPC_CONTROL

Kept = TypeVar("Kept")


class Stations:
    """Collects what the capture says about who is who.

    Args:
        most: how many stations to keep, without the oldest; and how many devices, the first ones.
        vendor_id: the assumed vendor of devices without one in the capture; None: no assumption.
    """

    def __init__(self, most: int = 65_536, vendor_id: int | None = None) -> None:
        self._most = most
        self._vendor_id = vendor_id
        self._servers: OrderedDict[str, Device] = OrderedDict()
        self.known: set[str] = set()
        """IP addresses of devices that are completely known from responses."""
        self._stations: OrderedDict[str, dcp.StationInfo] = OrderedDict()
        self._by_ip: OrderedDict[str, str] = OrderedDict()
        """IP address -> MAC address of the station that claimed it last."""

    def station(self, packet: Packet) -> None:
        """Takes a DCP or LLDP packet."""
        station = dcp.parse(packet) if packet.kind == "dcp" else lldp.parse(packet)
        if station is None or station.mac is None:
            return
        known = self._stations.get(station.mac)
        if known is not None:
            for key in ("ip", "name", "vendor_id", "device_id", "kind"):
                if getattr(station, key) is None:
                    setattr(station, key, getattr(known, key))
        self._keep(self._stations, station.mac, station)
        if station.ip is not None:
            self._keep(self._by_ip, station.ip, station.mac)

    def _keep(self, memory: OrderedDict[str, Kept], key: str, value: Kept) -> None:
        """Keeps a value as the newest one; beyond the limit the oldest is forgotten."""
        memory[key] = value
        memory.move_to_end(key)
        if len(memory) > self._most:
            memory.popitem(last=False)

    def message(self, pdu: rpc.Pdu) -> None:
        """Takes an RPC message: responses come from devices, a Connect names device and controller."""
        if pdu.ptype == 2 and pdu.opnum != RPC_CONTROL:  # a controller answers ApplicationReady
            self._learn(pdu.source, pdu.source_mac, pdu.object_uuid)
        elif pdu.ptype == 0 and pdu.opnum == RPC_CONNECT:
            self._learn(pdu.destination, None, pdu.object_uuid)

    def vendor(self, ip: str) -> int | None:
        """Vendor id of a device if its record call lacks it: as captured so far, else the assumed one."""
        device = self._servers.get(ip)
        if device is not None and device.vendor_id is not None:
            return device.vendor_id
        station = self._stations.get(self._by_ip.get(ip, ""))
        if station is None or station.ip != ip:
            station = self._stations.get((device and device.mac) or "")
        shown = station.vendor_id if station is not None else None
        return self._vendor_id if shown is None else shown

    def kind(self, ip: str) -> str | None:
        """The type of station of a device, from DCP; None if unknown."""
        station = self._stations.get(self._by_ip.get(ip, ""))
        return station.kind if station is not None and station.ip == ip else None

    def identity(self, ip: str) -> tuple[int, int] | None:
        """Vendor and device id of a device, from Connect or DCP so far; None if unknown."""
        for known in (self._servers.get(ip), self._stations.get(self._by_ip.get(ip, ""))):
            if known is None or known.ip != ip or known.vendor_id is None:
                continue
            if known.device_id is not None:
                return known.vendor_id, known.device_id
        return None

    def vendor_of(self, mac: str) -> int | None:
        """Vendor id of the station with a MAC address: as captured so far, else the assumed one."""
        station = self._stations.get(mac)
        if station is not None and station.vendor_id is not None:
            return station.vendor_id
        there = (each.vendor_id for each in self._servers.values() if each.mac == mac)
        return next((each for each in there if each is not None), self._vendor_id)

    def devices(self) -> list[Device]:
        """Every device that answered or was connected to, in the order of first sight."""
        by_ip = {station.ip: station for station in self._stations.values() if station.ip}
        for device in self._servers.values():
            station = by_ip.get(device.ip) or self._stations.get(device.mac or "")
            if station is not None:
                device.station = station.name
                device.mac = device.mac or station.mac
                device.vendor_id = (
                    device.vendor_id if device.vendor_id is not None else station.vendor_id
                )
                device.device_id = (
                    device.device_id if device.device_id is not None else station.device_id
                )
            device.assumed_vendor_id = self._vendor_id if device.vendor_id is None else None
        return list(self._servers.values())

    def _learn(self, ip: str, mac: str | None, object_uuid: bytes) -> None:
        device = self._servers.get(ip)
        if device is None:
            if len(self._servers) >= self._most:
                return
            device = self._servers[ip] = Device(ip)
        device.mac = device.mac or mac
        identity = rpc.device_identity(object_uuid)
        if identity is not None and device.vendor_id is None:
            device.vendor_id, device.device_id = identity
        if device.mac and device.vendor_id is not None:
            self.known.add(ip)
