#!/usr/bin/env python3
"""Judge scenarios by the JSON Schema alone. Usage: check_schema.py SCHEMA.json CASES.json

CASES holds [{"name", "valid", "instance"}, ...]. Prints the cases whose judgement differs from `valid`; exits 1 if there are any.
"""
import json
import sys

import jsonschema


def main():
    schema, cases = (json.load(open(path, encoding="utf-8")) for path in sys.argv[1:3])
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    wrong = 0
    for case in cases:
        errors = [error.message for error in validator.iter_errors(case["instance"])]
        if case["valid"] == (not errors):
            continue
        wrong += 1
        print(f'{case["name"]}: expected {"valid" if case["valid"] else "invalid"}, found {errors}')
    print(f"{len(cases)} cases, {wrong} judged wrongly")
    return 1 if wrong or not cases else 0


if __name__ == "__main__":
    sys.exit(main())
