"""Several hosts on one machine: each with a network and a host name of its own, joined by the hub (hub.py).

    network = Network(["a", "b"], seed=1)            # raises Unavailable where namespaces cannot be made
    process = network.hosts["a"].start(["ip", "address"], log)
    network.set(between=["a", "b"], loss=0.01, delay_ms=5)
    network.close()

A host is a pair of Linux namespaces (network, UTS) that nothing names: they live as long as a process or a descriptor holds
them. Every process started here dies with this one, so nothing remains however this one ends.
"""
import contextlib
import ctypes
import errno
import fcntl
import json
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys

INTERFACE = "tiltproof0"
ANSWER_LIMIT_S = 10

CLONE_NEWUTS, CLONE_NEWUSER, CLONE_NEWNET = 0x04000000, 0x10000000, 0x40000000
PR_SET_PDEATHSIG = 1
TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000
SIOCGIFFLAGS, SIOCSIFFLAGS, SIOCSIFADDR, SIOCSIFNETMASK = 0x8913, 0x8914, 0x8916, 0x891C
IFF_UP = 0x1

libc = ctypes.CDLL(None, use_errno=True)


class Unavailable(Exception):
    """This machine lets this user make no such network; the text says why."""


def check(result, what):
    if result != 0:
        code = ctypes.get_errno()
        raise Unavailable(f"{what}: {os.strerror(code)}")


def unshare(flags, what):
    check(libc.unshare(flags), what)


def isolate():
    """Leaves this machine's network and host name alone from here on. As root; else as root of a user namespace."""
    if libc.unshare(CLONE_NEWNET | CLONE_NEWUTS) == 0:
        return
    if ctypes.get_errno() != errno.EPERM:
        check(-1, "no network namespace can be made here")
    uid, gid = os.geteuid(), os.getegid()
    unshare(CLONE_NEWUSER | CLONE_NEWNET | CLONE_NEWUTS, "neither network nor user namespaces can be made by this user")
    try:
        pathlib.Path("/proc/self/setgroups").write_text("deny")
        pathlib.Path("/proc/self/uid_map").write_text(f"0 {uid} 1")
        pathlib.Path("/proc/self/gid_map").write_text(f"0 {gid} 1")
    except OSError as error:
        raise Unavailable(f"a user namespace cannot be set up here: {error}") from error


def die_with(parent):
    """For a new process: it is killed when its parent ends, in whatever way."""
    libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)


class Host:
    """One host, with its loopback and one interface to the hub, up and with an address."""

    def __init__(self, name, address):
        self.name, self.address = name, address
        with contextlib.ExitStack() as stack:
            back = {kind: stack.enter_context(open(f"/proc/self/ns/{kind}", "rb")) for kind in ("net", "uts")}
            unshare(CLONE_NEWNET | CLONE_NEWUTS, "no network namespace can be made here")
            try:
                self.namespaces = [os.open(f"/proc/self/ns/{kind}", os.O_RDONLY | os.O_CLOEXEC) for kind in back]
                socket.sethostname(name)
                self.tap = self._make_tap()
                self._configure("lo", None)
                self._configure(INTERFACE, address)
            finally:
                for file in back.values():
                    check(libc.setns(file.fileno(), 0), "cannot return from a namespace")

    @staticmethod
    def _make_tap():
        try:
            tap = os.open("/dev/net/tun", os.O_RDWR | os.O_CLOEXEC)
            fcntl.ioctl(tap, TUNSETIFF, struct.pack("16sH22x", INTERFACE.encode(), IFF_TAP | IFF_NO_PI))
        except OSError as error:
            raise Unavailable(f"no TAP device can be made through /dev/net/tun: {error.strerror}") from error
        return tap

    @staticmethod
    def _configure(interface, address):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
            def set_address(request, value):
                fcntl.ioctl(control, request,
                            struct.pack("16sH2x4s16x", interface.encode(), socket.AF_INET, socket.inet_aton(value)))

            if address is not None:
                set_address(SIOCSIFADDR, address)
                set_address(SIOCSIFNETMASK, "255.255.255.0")
            flags, = struct.unpack_from("H", fcntl.ioctl(control, SIOCGIFFLAGS, struct.pack("16s24x", interface.encode())), 16)
            fcntl.ioctl(control, SIOCSIFFLAGS, struct.pack("16sH22x", interface.encode(), flags | IFF_UP))

    def start(self, command, log):
        """Starts a process on this host, in a group of its own; what it prints goes to the file `log`."""
        parent = os.getpid()

        def enter():
            die_with(parent)
            for namespace in self.namespaces:
                if libc.setns(namespace, 0) != 0:
                    os._exit(126)

        return subprocess.Popen(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                                preexec_fn=enter, start_new_session=True)

    def close(self):
        for descriptor in (*self.namespaces, self.tap):
            os.close(descriptor)


class Network:
    """Hosts by name, and the hub between them."""

    def __init__(self, names, seed):
        self.hosts = {}
        self.hub = None
        try:
            for number, name in enumerate(names, 1):
                self.hosts[name] = Host(name, f"10.77.0.{number}")
            taps = {name: host.tap for name, host in self.hosts.items()}
            parent = os.getpid()
            self.hub = subprocess.Popen(
                [sys.executable, pathlib.Path(__file__).with_name("hub.py"), str(seed), *(f"{n}={t}" for n, t in taps.items())],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, pass_fds=taps.values(), preexec_fn=lambda: die_with(parent))
            self.set()
        except BaseException:
            self.close()
            raise

    def set(self, **settings):
        """Changes the links (see hub.py). Returns their counters."""
        self.hub.stdin.write(json.dumps(settings).encode() + b"\n")
        self.hub.stdin.flush()
        line = self.hub.stdout.readline()
        if not line:
            raise RuntimeError(f"the hub has ended: {self.hub.wait(ANSWER_LIMIT_S)}")
        return json.loads(line)

    def close(self):
        if self.hub is not None:
            self.hub.kill()
            self.hub.wait()
            self.hub.stdin.close()
            self.hub.stdout.close()
        for host in self.hosts.values():
            host.close()
        self.hosts, self.hub = {}, None
