"""Finds the program tiltproof, and runs it."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
from typing import Sequence


class Error(Exception):
    """The program refuses or fails; the message is its own, with the place and the fix."""


def find_program() -> str:
    """The program: the environment's TILTPROOF, or that of this source tree, or the installed one."""
    named = os.environ.get("TILTPROOF")
    if named:
        return named
    built = pathlib.Path(__file__).resolve().parents[2] / "build" / "release" / "tiltproof"
    if built.is_file():
        return str(built)
    installed = shutil.which("tiltproof")
    if installed is None:
        raise Error("the program tiltproof is not installed: put it on the PATH, or name it in TILTPROOF")
    return installed


def run(arguments: Sequence[str], accepted: Sequence[int]) -> str:
    """The standard output of a command. Raises Error for an exit code that is not accepted."""
    done = subprocess.run([find_program(), *arguments], capture_output=True, text=True, check=False)
    if done.returncode not in accepted:
        raise Error(done.stderr.strip() or f"{arguments[0]} ended with exit code {done.returncode}")
    return done.stdout
