"""Remarks to findings, and findings to headlines: for every channel, in no language.

The judges are in the rooms of the channels and in `ds47.diagnosis`; the words are in `ds47.report.sentences`.
"""
