#!/usr/bin/env python3
"""Serial cables between hosts: pairs of pseudo-terminals, and this process, which carries the bytes of each pair both ways.

Usage: cable.py COUNT    prints the two ends of each cable, one cable a line; ends with its standard input
"""
import contextlib
import os
import pty
import select
import sys
import tty


def main():
    # A cable never waits: where it is allowed, neither does this.
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    other_of, kept = {}, []
    for _ in range(int(sys.argv[1])):
        masters, slaves = zip(*(pty.openpty() for _ in range(2)))
        for slave in slaves:
            tty.setraw(slave)
        kept.extend(slaves)  # so that an end that nothing has open loses what comes, as a cable does
        other_of.update({masters[0]: masters[1], masters[1]: masters[0]})
        print(*map(os.ttyname, slaves), flush=True)
    for master in other_of:
        os.set_blocking(master, False)
    while True:
        ready, _, _ = select.select([0, *other_of], [], [])
        for descriptor in ready:
            if descriptor == 0:
                return
            with contextlib.suppress(BlockingIOError):
                data = os.read(descriptor, 4096)
                # Bytes that a full end has no room for are lost.
                os.write(other_of[descriptor], data)


if __name__ == "__main__":
    main()
