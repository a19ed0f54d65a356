#!/usr/bin/env python3
"""A network hub in user space between hosts of a test, which can be bad on purpose.

Usage: hub.py SEED NAME=FD...    one TAP device a host, as an open file descriptor

Ethernet frames that come in at one host go out at the others that they are for; broadcast and multicast go to all. What
happens in between is set by commands on standard input, one JSON object a line, answered by one on standard output:

  {"loss": 0.01, "delay_ms": 5}                     every link (a link joins two hosts, both ways)
  {"between": ["a", "b"], "cut": true}              one link
  {"multicast": false}                              the hub passes no IP multicast any more
  {}                                                changes nothing: the answer is the counters so far

Link settings: loss and duplicate (probability a frame, 0 to 1), delay_ms, cut. Counters, by link ("a-b"): passed, lost,
duplicated, cut, multicast_blocked. It ends with its standard input.
"""
import contextlib
import dataclasses
import heapq
import itertools
import json
import os
import random
import select
import sys
import time

FRAME_BYTES_MAX = 2048  # a TAP device's MTU is 1500
IP_MULTICAST = bytes.fromhex("01005e")
# A duplicate comes a little later than its original, so that it overtakes what was sent in between.
DUPLICATE_LATER_S = 0.002


@dataclasses.dataclass
class Link:
    loss: float = 0
    duplicate: float = 0
    delay_ms: float = 0
    cut: bool = False
    counters: dict = dataclasses.field(
        default_factory=lambda: dict.fromkeys(("passed", "lost", "duplicated", "cut", "multicast_blocked"), 0))


class Hub:
    def __init__(self, seed, taps):
        self.random = random.Random(seed)
        self.taps = taps  # host -> descriptor
        self.links = {frozenset(pair): Link() for pair in itertools.combinations(taps, 2)}
        self.multicast = True
        self.host_of = {}  # Ethernet address -> host, learned
        self.waiting = []  # heap of (due, number, host, frame)
        self.numbers = itertools.count()

    def obey(self, command):
        command = dict(command)
        self.multicast = command.pop("multicast", self.multicast)
        between = command.pop("between", None)
        for pair, link in self.links.items():
            if between is None or pair == frozenset(between):
                for name, value in command.items():
                    if name not in ("loss", "duplicate", "delay_ms", "cut"):
                        raise ValueError(f"no such setting: {name}")
                    setattr(link, name, value)
        return {"-".join(sorted(pair)): link.counters for pair, link in self.links.items()}

    def on_frame(self, source, frame):
        if len(frame) < 14:
            return
        to, sender = frame[:6], frame[6:12]
        self.host_of[sender] = source
        known = None if to[0] & 1 else self.host_of.get(to)
        for host in self.taps:
            if host != source and known in (None, host):
                self.carry(self.links[frozenset((source, host))], host, frame)

    def carry(self, link, host, frame):
        counters = link.counters
        if link.cut:
            counters["cut"] += 1
        elif not self.multicast and frame.startswith(IP_MULTICAST):
            counters["multicast_blocked"] += 1
        elif self.random.random() < link.loss:
            counters["lost"] += 1
        else:
            counters["passed"] += 1
            due = time.monotonic() + link.delay_ms * 1e-3
            heapq.heappush(self.waiting, (due, next(self.numbers), host, frame))
            if self.random.random() < link.duplicate:
                counters["duplicated"] += 1
                heapq.heappush(self.waiting, (due + DUPLICATE_LATER_S, next(self.numbers), host, frame))

    def deliver(self):
        """Seconds until the next frame is due; None when none waits."""
        while self.waiting:
            wait = self.waiting[0][0] - time.monotonic()
            if wait > 0:
                return wait
            _, _, host, frame = heapq.heappop(self.waiting)
            try:
                os.write(self.taps[host], frame)
            except OSError:
                pass  # its queue is full, or the device is down: a lost frame
        return None

    def run(self):
        source_of = {tap: host for host, tap in self.taps.items()}
        buffered = b""
        while True:
            ready, _, _ = select.select([0, *source_of], [], [], self.deliver())
            for descriptor in ready:
                if descriptor in source_of:
                    try:
                        while True:
                            self.on_frame(source_of[descriptor], os.read(descriptor, FRAME_BYTES_MAX))
                    except BlockingIOError:
                        continue
                data = os.read(0, 65536)
                if not data:
                    return
                *lines, buffered = (buffered + data).split(b"\n")
                for line in lines:
                    print(json.dumps(self.obey(json.loads(line))), flush=True)


def main():
    # A cable never waits: where it is allowed, neither does this.
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    taps = {name: int(descriptor) for name, _, descriptor in (a.partition("=") for a in sys.argv[2:])}
    for tap in taps.values():
        os.set_blocking(tap, False)
    Hub(int(sys.argv[1]), taps).run()


if __name__ == "__main__":
    main()
