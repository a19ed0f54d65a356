#!/usr/bin/env python3
"""What words.py finds, and what it leaves alone.

Usage: words_test.py
"""
import unittest

import words

LONG = "one " * 31


def found(text):
    return [(number, problem.split(":")[0]) for number, problem in words.of_page(text)]


class WordsTest(unittest.TestCase):
    def test_a_long_sentence_is_found_where_its_paragraph_starts(self):
        self.assertEqual(found(f"# Title\n\nShort. O{LONG[1:100]}\n{LONG[100:].strip()}.\n"), [(3, "a sentence of 31 words")])
        self.assertEqual(found(f"- First.\n- {LONG[:80]}\n  {LONG[80:].strip()}.\n"), [(2, "a sentence of 31 words")])
        half = "one " * 16
        self.assertEqual(found(f"{half.strip()}. \nO{half[1:].strip()}.\n"), [])

    def test_a_code_span_is_one_word_and_a_link_is_its_text(self):
        self.assertEqual(found("`a b c d e f g h i j k l m n o p q r s t u v w x y z a b c d e f g`\n"), [])
        self.assertEqual(found("[text](an address of a page that is longer than thirty words " + "a " * 10 + ")\n"), [])

    def test_code_comments_and_sources_are_no_prose(self):
        self.assertEqual(found(f"```\n{LONG}\n```\n\n    {LONG}\n\n<!-- {LONG} -->\n"), [])
        self.assertEqual(found(f"Source: {LONG[:88]}\n{LONG[88:]}.\n"), [])

    def test_code_after_a_list_that_a_reader_gets_as_a_paragraph_is_found(self):
        self.assertEqual(found(f"- item\n\n    {LONG[:88]}\n    {LONG[88:]}\n"), [(3, "a sentence of 31 words")])
        self.assertEqual(found(f"1. item\n\n       {LONG}\n"), [])

    def test_words_headings_and_wide_lines(self):
        self.assertEqual(found("It starts anew.\n"), [(1, "'anew'")])
        self.assertEqual(found("Nobody knows `anew`.\n"), [(1, "'Nobody'")])
        self.assertEqual(found("## What it does\n"), [(1, "a heading starts with 'What'")])
        self.assertEqual(found("word " * 23 + "\n"), [(1, "115 columns, at most 110")])
        self.assertEqual(found("| " + "word; " * 30 + " |\n"), [])

    def test_each_part_of_a_table_cell_counts_alone(self):
        self.assertEqual(found(f"| {LONG[:80]}; {LONG[80:]} |\n"), [])
        self.assertEqual(found(f"| a | {LONG} |\n"), [(1, "a sentence of 31 words")])

    def test_descriptions_of_scenarios(self):
        text = f"name: a\ndescription: >-\n  Short.\n  {LONG}.\nduration_s: 3\n"
        self.assertEqual([number for number, _ in words.of_scenario(text)], [2])
        self.assertEqual(list(words.of_scenario(f"description: Short.\nother: {LONG}\n")), [])


if __name__ == "__main__":
    unittest.main()
