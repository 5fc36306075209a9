"""A cable between two network name spaces, and what is done to the packets on it: lost, late, doubled.

Each end is a TUN device; packets are carried between both by this process, with a seed.  Needs root (CAP_NET_ADMIN,
CAP_SYS_ADMIN) and /dev/net/tun."""

import contextlib
import ctypes
import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import threading
import time

CLONE_NEWNET, TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x40000000, 0x400454CA, 0x1, 0x1000
libc = ctypes.CDLL(None, use_errno=True)


def _ask(call, *args):
    if call(*args) != 0:
        e = ctypes.get_errno()
        raise OSError(e, os.strerror(e))


class Host:
    """A network name space with one end of the cable, `device`, at `address`."""

    device = "cable"

    def __init__(self, address):
        self.address = address
        own = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
        try:
            _ask(libc.unshare, CLONE_NEWNET)
            try:
                self.space = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
                self.end = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
                fcntl.ioctl(self.end, TUNSETIFF, struct.pack("16sH", self.device.encode(), IFF_TUN | IFF_NO_PI))
                for command in ("link set lo up", f"addr add {address}/24 dev {self.device}", f"link set {self.device} up multicast on"):
                    subprocess.run(["ip", *command.split()], check=True, capture_output=True)
            finally:
                _ask(libc.setns, own, CLONE_NEWNET)
        finally:
            os.close(own)

    def start(self, *command, **kw):
        """A process that lives on this host."""
        return subprocess.Popen([str(c) for c in command], preexec_fn=lambda: _ask(libc.setns, self.space, CLONE_NEWNET), **kw)

    def close(self):
        os.close(self.end)
        os.close(self.space)


class Cable:
    """Carries packets between two hosts until it is cut."""

    def __init__(self, loss=0.0, doubled=0.0, late_s=0.0, seed=1):
        self.loss, self.doubled, self.late_s = loss, doubled, late_s
        self.random = random.Random(seed)
        self.hosts = [Host("10.98.0.1"), Host("10.98.0.2")]
        self.carried = self.lost = 0
        self.over = False
        self.thread = threading.Thread(target=self._carry, daemon=True)
        self.thread.start()

    def _carry(self):
        ends, waiting, count = [h.end for h in self.hosts], [], 0
        while not self.over:
            wait = min(0.05, max(0, waiting[0][0] - time.monotonic())) if waiting else 0.05
            for fd in select.select(ends, [], [], wait)[0]:
                packet = os.read(fd, 65536)
                if self.random.random() < self.loss:
                    self.lost += 1
                    continue
                for _ in range(2 if self.random.random() < self.doubled else 1):
                    count += 1
                    heapq.heappush(waiting, (time.monotonic() + self.late_s, count, ends[1 - ends.index(fd)], packet))
            while waiting and waiting[0][0] <= time.monotonic():
                _, _, to, packet = heapq.heappop(waiting)
                with contextlib.suppress(OSError):  # a full queue loses it, as cables do
                    os.write(to, packet)
                self.carried += 1

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.over = True
        self.thread.join()
        for h in self.hosts:
            h.close()
