#!/usr/bin/env python3
"""Shows every flight of a JUnit file that is not green as an annotation of GitHub Actions. Usage: annotate.py junit.xml"""
import sys
import xml.etree.ElementTree as xml


def escaped(text, also=""):
    """As GitHub wants values of its workflow commands; `also`: what ends a property."""
    for character in "%\r\n" + also:
        text = text.replace(character, f"%{ord(character):02X}")
    return text


for case in xml.parse(sys.argv[1]).iter("testcase"):
    for trouble in (*case.findall("failure"), *case.findall("error")):
        text = trouble.get("message", "") + "\n" + (trouble.text or "")
        print(f"::error title={escaped(case.get('name'), ':,')}::{escaped(text.strip())}")
