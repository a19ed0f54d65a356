#!/usr/bin/env python3
"""The cost of the module's calls beside the flight itself, in microseconds of wall time: the least of many, since other
programs may have the processors meanwhile. Usage: PYTHONPATH=python session_calls.py SCENARIO"""
import sys
import time

import tiltproof


def least_us(call, count=2000):
    least = float("inf")
    for _ in range(count):
        began = time.perf_counter()
        call()
        least = min(least, time.perf_counter() - began)
    return 1e6 * least


with tiltproof.fly(sys.argv[1]) as flight:
    flight.advance(0.5)
    print(f"advance(0)       {least_us(lambda: flight.advance(0)):6.1f} us")
    print(f"until, holds     {least_us(lambda: flight.until('z_m > -100')):6.1f} us")
    print(f"flight[signal]   {least_us(lambda: flight['z_m']):6.1f} us")
    print(f"inject, remove   {least_us(lambda: flight.remove(flight.inject('sensor.bias', signal='x_m', offset=0)), 20):6.1f} us")
    flight.stop()
